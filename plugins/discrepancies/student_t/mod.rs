//! `student_t`: differences with heavy tails.

mod latent;
mod likelihood;
#[cfg(test)]
mod tests;

use lacuna::data::{Layout, Measurements};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::component::{Component, Context};
use lacuna::plugin::discrepancy::{Discrepancy, Known, Likelihood, StatedNoise};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{By, Groups, Quantity};
use likelihood::StudentLikelihood;

/// Independent differences with heavy tails: Student's t distribution, with one scale or one for each group of
/// outputs.
///
/// Every measured value is the model's response, plus the errors common to all replicates, plus `scale` times a
/// number from Student's t distribution with `degrees_of_freedom` (Lange, Little and Taylor, J. American Statistical
/// Association 84 (1989) 881). An outlier then affects the parameters less than under the normal distribution, which
/// is the limit of many degrees of freedom.
///
/// The errors common to all replicates stay normal, and with them the likelihood has no closed form. They are
/// sampled: the standard normal weights of some of their directions are unknowns of the study, named `common[1]`,
/// `common[2]`, …. These are the leading directions, at most `common.most`, and those on which the estimates depend:
/// with as many of the latter as there are parameters, the posterior of a linear model under normal noise of known
/// variance is that with the full covariance. For noise of unknown variance, directions are kept for several sizes of
/// the noise: three per parameter with replicates and five without. Errors along other directions count as noise, and
/// the assessment reports where that shifts the estimates (`sampled_errors`). Predictions of new data include all of
/// these errors. Every value enters the likelihood separately, since Student's t distribution has no sufficient
/// statistics.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StudentT {
    /// Scale, in the unit of the response: a prior such as `{ half_normal = 1e-5 }`, or `{ known = 5e-6 }`. Unknown
    /// ones are named `scale`, or `scale[B]`, and are sampled as logarithms, with the Jacobian. The standard
    /// deviation is `sqrt(d / (d - 2))` times the scale for `d` degrees of freedom.
    pub scale: Quantity,
    /// Groups of outputs with a common scale: `"all"`, one per value of an axis such as `"sensor"`, windows of an
    /// axis, or a list of these.
    #[serde(default)]
    pub by: By,
    /// Degrees of freedom, above 2: `{ known = 4 }` or a prior. The default prior is that of Juárez and Steel (J.
    /// Business and Economic Statistics 28 (2010) 52). Values of 2 and less, for which the variance is infinite, are
    /// excluded.
    #[serde(default = "degrees_of_freedom")]
    pub degrees_of_freedom: Quantity,
    /// Number of leading directions of the common errors that are sampled.
    #[serde(default)]
    pub common: Directions,
}

/// Number of leading directions of the common errors that are sampled, in addition to those on which the estimates
/// depend.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Directions {
    /// Fraction of the common errors' variance, in units of the noise of the mean curve, that the leading directions
    /// must carry; from 0 to 1.
    pub share: f64,
    /// Maximum number of leading directions. Each adds an unknown.
    pub most: usize,
}

impl Default for Directions {
    fn default() -> Self {
        Self { share: 0.99, most: 20 }
    }
}

fn degrees_of_freedom() -> Quantity {
    Quantity::Unknown(Distribution::Gamma([2.0, 10.0]))
}

impl Component for StudentT {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.by.check("by", context.layout, complaints);
        let groups = Groups::of(context.layout, &self.by).map_or(1, |g| g.count());
        self.scale.check_positive("scale", groups, complaints);
        self.degrees_of_freedom.check_positive("degrees_of_freedom", 1, complaints);
        let most = match &self.degrees_of_freedom {
            Quantity::Known(values) => values.first().copied().unwrap_or(f64::NAN),
            Quantity::Unknown(prior) => prior.support().1,
        };
        if most.is_nan() || most <= 2.0 {
            complaints
                .at("degrees_of_freedom")
                .say("there is no variance for 2 degrees of freedom or less")
                .expected("a number above 2")
                .found(most);
        }
        if !(0.0..=1.0).contains(&self.common.share) {
            complaints
                .at("common.share")
                .say("the fraction must be from 0 to 1")
                .found(self.common.share);
        }
    }
}

impl Discrepancy for StudentT {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        Ok(Box::new(StudentLikelihood::new(self, known)?))
    }

    fn likelihood_of_part(
        &self,
        known: &Known<'_>,
        part: &Measurements,
    ) -> Result<Option<Box<dyn Likelihood>>, Stop> {
        Ok(Some(Box::new(StudentLikelihood::of_part(self, known, part)?)))
    }

    fn stated_noise(&self, layout: &Layout, _: &[f64]) -> Option<StatedNoise> {
        let scales = self.scale.known(layout, &self.by)?;
        let degrees = self.degrees_of_freedom.known(layout, &By::default())?;
        let sd = scales.iter().zip(degrees).map(|(s, d)| s * (d / (d - 2.0)).sqrt()).collect();
        Some(StatedNoise { sd, correlation_time: None })
    }
}

lacuna::register!(Discrepancy, "student_t", StudentT, aliases: ["t", "student"], revision = 2);
