//! `multiplicative_gaussian`: normal differences in proportion to the model's response.

#[cfg(test)]
mod tests;

use lacuna::data::{Layout, Measurements, Unit};
use lacuna::math::random::Stream;
use lacuna::plugin::component::{Component, Context};
use lacuna::plugin::discrepancy::{
    Discrepancy, ErrorPath, Hyperparameter, Known, Likelihood, StatedNoise, VariancePart,
};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{By, Groups, Normal, PerGroup, Quantity, Replicates, Setting, Unknown, start};

/// Normal differences in proportion to the model's response, with an optional floor.
///
/// Every measured value is `y = m (1 + e1) + e0` with the model's response `m`, a relative error `e1` with zero mean
/// and standard deviation `relative`, and an absolute error `e0` with standard deviation `floor`: a normal number of
/// variance `relative^2 m^2 + floor^2` (the proportional and the combined error model of Gelman et al., Bayesian Data
/// Analysis (2013), and of pharmacometrics). Choose it for sensors and models whose errors are a fraction of the
/// signal.
///
/// Without a floor a response of exactly zero has no error, and the likelihood is zero unless the data are zero as
/// well: give a floor if a signal starts from rest. Since the variance depends on the response, the likelihood is not
/// reduced to the emulator's basis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MultiplicativeGaussian {
    /// Relative standard deviation, a fraction of the response: a prior such as `{ half_normal = 0.2 }`, or
    /// `{ known = 0.05 }`. Unknown ones are named `relative`, or `relative[B]`.
    pub relative: Quantity,
    /// Groups of outputs with a common relative standard deviation: `"all"`, one per value of an axis such as
    /// `"sensor"`, windows of an axis, or a list of these.
    #[serde(default)]
    pub by: By,
    /// Absolute standard deviation, in the unit of the response; an unknown one is named `floor`. Default: no
    /// absolute error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor: Option<Quantity>,
}

impl Component for MultiplicativeGaussian {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.by.check("by", context.layout, complaints);
        let groups = Groups::of(context.layout, &self.by).map_or(1, |g| g.count());
        self.relative.check_positive("relative", groups, complaints);
        if let Some(floor) = &self.floor {
            floor.check_positive("floor", 1, complaints);
        }
    }
}

impl Discrepancy for MultiplicativeGaussian {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        let replicates = Replicates::of(known.data, known.common)?;
        let layout = &known.data.layout;
        let groups =
            Groups::of(layout, &self.by).map_err(Stop::new)?.with_data(&replicates.measured);
        let mut hyper = Vec::new();
        let unit = vec![1.0; layout.len()];
        let square = |g: usize| {
            let own = |k: &usize| groups.of[replicates.measured[*k]] == Some(g);
            let kept: Vec<usize> = (0..replicates.mean.len()).filter(own).collect();
            kept.iter().map(|&k| replicates.mean[k].powi(2)).sum::<f64>() / kept.len() as f64
        };
        let begin = |g: usize| (start(&groups, &replicates, &unit, g) / square(g)).sqrt();
        let name = Unknown { name: "relative", unit: Unit::dimensionless() };
        let relative = PerGroup::new(&self.relative, &groups, &name, begin, &mut hyper);
        let one = Groups::of(layout, &By::default()).map_err(Stop::new)?;
        let name = Unknown { name: "floor", unit: layout.unit.difference() };
        let small = |g: usize| 0.1 * start(&one, &replicates, &unit, g).sqrt();
        let floor = self.floor.as_ref().map(|f| PerGroup::new(f, &one, &name, small, &mut hyper));
        Ok(Box::new(Proportional {
            setting: Setting::new(known, &replicates, &groups),
            normal: Normal::new(&replicates, known.common)?,
            groups,
            relative,
            floor,
            hyper,
        }))
    }

    fn likelihood_of_part(
        &self,
        known: &Known<'_>,
        part: &Measurements,
    ) -> Result<Option<Box<dyn Likelihood>>, Stop> {
        // No parameter of the distribution is taken from the replicates.
        self.likelihood(&Known { data: part, ..*known }).map(Some)
    }

    fn stated_noise(&self, layout: &Layout, response: &[f64]) -> Option<StatedNoise> {
        let relative = self.relative.known(layout, &self.by)?;
        let floor = match &self.floor {
            Some(floor) => floor.known(layout, &By::default())?,
            None => vec![0.0; layout.len()],
        };
        let each = relative.iter().zip(response).zip(floor);
        let sd = each.map(|((r, m), floor)| (r * m).hypot(floor)).collect();
        Some(StatedNoise { sd, correlation_time: None })
    }
}

struct Proportional {
    setting: Setting,
    normal: Normal,
    groups: Groups,
    relative: PerGroup,
    floor: Option<PerGroup>,
    hyper: Vec<Hyperparameter>,
}

impl Proportional {
    /// Returns the relative standard deviations of the groups and the floor; `None` if one is not above zero.
    fn values<'a>(&'a self, hyper: &'a [f64]) -> Option<(&'a [f64], f64)> {
        let floor = match &self.floor {
            Some(floor) => floor.values(hyper)?[0],
            None => 0.0,
        };
        Some((self.relative.values(hyper)?, floor))
    }

    /// Returns the variance of each output.
    fn variance(&self, response: &[f64], hyper: &[f64]) -> Option<Vec<f64>> {
        let (relative, floor) = self.values(hyper)?;
        let relative = self.groups.spread(relative);
        Some(relative.iter().zip(response).map(|(r, m)| (r * m).powi(2) + floor * floor).collect())
    }

    fn measured(&self, all: &[f64]) -> Vec<f64> {
        self.normal.replicates.measured.iter().map(|&i| all[i]).collect()
    }
}

impl Likelihood for Proportional {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        let variance = self.variance(response, hyper).map(|v| self.measured(&v));
        let solved = variance.and_then(|v| self.normal.solve(response, &v));
        solved.map(|s| s.log_likelihood).filter(|l| !l.is_nan()).unwrap_or(f64::NEG_INFINITY)
    }

    fn is_cheap(&self) -> bool {
        self.normal.factor.columns() == 0
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let nothing = || (vec![0.0; response.len()], vec![0.0; hyper.len()]);
        let parts = self.values(hyper).zip(self.variance(response, hyper));
        let Some(((relative, floor), variance)) = parts else { return nothing() };
        let variance = self.measured(&variance);
        let Some(solved) = self.normal.solve(response, &variance) else { return nothing() };
        let mut by_response = self.normal.by_response(&solved, &variance);
        let by_variance = self.normal.by_variance(&solved, &variance);
        let (mut by_relative, mut by_floor) = (vec![0.0; relative.len()], 0.0);
        for (k, (&i, slope)) in self.normal.replicates.measured.iter().zip(&by_variance).enumerate()
        {
            let Some(g) = self.groups.of[i] else { continue };
            let (rho, m) = (relative[g], response[i]);
            by_response[k] += slope * 2.0 * rho * rho * m;
            by_relative[g] += slope * 2.0 * rho * m * m;
            by_floor += slope * 2.0 * floor;
        }
        let mut by_hyper = vec![0.0; hyper.len()];
        self.relative.add_gradient(&by_relative, &mut by_hyper);
        if let Some(floor) = &self.floor {
            floor.add_gradient(&[by_floor], &mut by_hyper);
        }
        (self.normal.replicates.over_all(&by_response, response.len()), by_hyper)
    }

    fn left_out(&self, response: &[f64], hyper: &[f64]) -> Option<Vec<f64>> {
        let variance = self.measured(&self.variance(response, hyper)?);
        let solved = self.normal.solve(response, &variance)?;
        Some(self.normal.left_out(&solved, &self.setting.data, response, &variance))
    }

    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        self.setting.parts(&self.variance(response, hyper).unwrap_or_default())
    }

    fn errors(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        self.setting.errors(&self.variance(response, hyper).unwrap_or_default(), stream)
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let variance = self.variance(response, hyper).unwrap_or_default();
        vec![self.setting.simulate(response, &variance, stream)]
    }
}

lacuna::register!(Discrepancy, "multiplicative_gaussian", MultiplicativeGaussian, aliases: ["relative", "proportional"]);
