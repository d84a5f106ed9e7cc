//! `approximate_bayesian_computation`: a likelihood that is a distance between measured and simulated samples.

mod histogram;
mod likelihood;
mod metric;
mod pairs;
mod projections;
#[cfg(test)]
mod tests;

use lacuna::data::{Layout, Unit};
use lacuna::math::random::Stream;
use lacuna::plugin::component::{Component, Context};
use lacuna::plugin::discrepancy::{Discrepancy, Known, Likelihood, StatedNoise, StochasticModel};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{By, Groups, Noise, PerGroup, Quantity, Replicates, Series, Unknown, Variance};
use likelihood::{Approximate, Set, common_draws};
pub use metric::Metric;
use metric::ToData;

/// Approximate Bayesian computation: parameters are likely if data simulated with them are at a small distance from the
/// measured ones.
///
/// The distance is one of distributions. All values of a set of points form a sample, measured and simulated, whatever
/// their order. With `axis_weight` the points have two coordinates, place and value, so that a feature which comes a
/// little too late is at a small distance from the measured one, and not at two full heights (curve matching; Bernton
/// et al., J. R. Stat. Soc. B 81 (2019) 235). With `sample = true` the response is a sample of a random quantity: what
/// a stochastic simulator returns, or quantiles. Choose this discrepancy if no likelihood can be written down: times
/// that scatter, outputs with two modes, realisations that have no partner among the data.
///
/// The likelihood is the mean of the kernel over `simulations` data sets (Del Moral, Doucet and Jasra, Statistics and
/// Computing 22 (2012) 1009),
///
/// ```text
/// mean over simulated sets of Π_g exp(-d_g² / (2 tolerance²)) / tolerance
/// ```
///
/// with one distance `d_g` for each set of points `g` (`distance_by`). A simulated data set is the response, one draw
/// of the common errors, and noise of `variance`. The random numbers are the same at each evaluation, so that every
/// sampler can be used; the result is that of this estimate of the likelihood, which more `simulations` improve. With
/// `sequential_monte_carlo` the tolerance falls from infinity to its value in steps chosen by the effective sample
/// size: a likelihood raised to the power `β` is one of the tolerance `tolerance / √β`. This is the adaptive method of
/// the paper above, and with the Jensen-Shannon distance that of Yang et al., Mechanical Systems and Signal Processing
/// (2022).
///
/// The posterior is that of data known to within `tolerance`. As the tolerance vanishes it becomes the posterior given
/// the sample; as it grows, the prior. Lower it until the posterior does not change, and raise `simulations` meanwhile:
/// at the MAP the kernel must exceed zero for many of them. Evidences with different metrics are not comparable.
/// Leave-one-out predictions do not exist. The cost of `wasserstein` grows as `n log n` with the number of points, that
/// of `jensen_shannon` as `n`, the others as `n²`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ApproximateBayesianComputation {
    /// Distance between the measured and a simulated sample.
    #[serde(default)]
    pub metric: Metric,
    /// Tolerance of the distance, in its unit: `{ known = 0.1 }`, or a prior such as `{ half_normal = 0.1 }` if it is
    /// to be found; unknown ones are named `tolerance`, or `tolerance[B]`.
    pub tolerance: Quantity,
    /// Sets of points with a distance of their own: `"all"`, one per value of an axis such as `"sensor"`, windows of an
    /// axis, or a list of these. With the axis of the points themselves each place is compared alone, over the
    /// replicates.
    #[serde(default)]
    pub distance_by: By,
    /// Distance in the unit of the response that a distance of 1 along the axis is worth: the height of a feature over
    /// its width, for example. Default: the places along the axis do not count.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis_weight: Option<f64>,
    /// Name of the numeric axis of `axis_weight`. Default: the last numeric axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub along: Option<String>,
    /// True if the values of a set are a sample of a random quantity: each simulated data set then takes as many values
    /// from the response as were measured, at random with replacement.
    #[serde(default)]
    pub sample: bool,
    /// Number of simulated data sets.
    #[serde(default = "simulations")]
    pub simulations: usize,
    /// Width of the kernel of `maximum_mean_discrepancy`, or of the smoothing of `jensen_shannon`, in the unit of the
    /// response. Default: the median distance between measured points, or Silverman's width for the measured values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bandwidth: Option<f64>,
    /// Variance of the noise, in the squared unit of the response: a prior such as `{ half_normal = 1e-6 }`,
    /// `{ known = 2.5e-11 }`, or a multiple of the measured variance, `{ measured = { known = 1 } }`, as for
    /// `gaussian`.
    pub variance: Variance,
    /// Groups of outputs with a common variance of the noise: `"all"`, one per value of an axis such as `"sensor"`,
    /// windows of an axis, or a list of these.
    #[serde(default)]
    pub by: By,
}

fn simulations() -> usize {
    50
}

/// Largest number of simulated data sets.
const MOST: usize = 100_000;

impl Component for ApproximateBayesianComputation {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let layout = context.layout;
        self.by.check("by", layout, complaints);
        self.variance.check(Groups::of(layout, &self.by).ok().as_ref(), complaints);
        self.distance_by.check("distance_by", layout, complaints);
        let groups = Groups::of(layout, &self.distance_by).map_or(1, |g| g.count());
        self.tolerance.check_positive("tolerance", groups, complaints);
        for (key, value) in [("axis_weight", self.axis_weight), ("bandwidth", self.bandwidth)] {
            if let Some(value) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
                complaints.at(key).say("this must be above zero").found(value);
            }
        }
        if !(1..=MOST).contains(&self.simulations) {
            let spot = complaints.at("simulations");
            spot.say("this number of simulated data sets is out of range")
                .expected(format!("1 to {MOST}"))
                .found(self.simulations);
        }
        self.check_order(layout, complaints);
        if self.bandwidth.is_some() && matches!(self.metric, Metric::Wasserstein | Metric::Energy) {
            complaints.at("bandwidth").say("this metric has no bandwidth").expected(
                "none, or one of the metrics `maximum_mean_discrepancy` and `jensen_shannon`",
            );
        }
    }
}

impl ApproximateBayesianComputation {
    /// Reports options of the axis that contradict each other or the response.
    fn check_order(&self, layout: &Layout, complaints: &mut Complaints<'_>) {
        if self.axis_weight.is_none() {
            if self.along.is_some() {
                complaints
                    .at("along")
                    .say("without `axis_weight` the places along an axis do not count")
                    .expected("`axis_weight` as well, or no `along`");
            }
            return;
        }
        if let Err(text) = Series::of(layout, self.along.as_deref()) {
            complaints.at("along").say(text);
        }
        if self.sample {
            complaints
                .at("axis_weight")
                .say("a sample has no order, so that places along an axis do not count")
                .expected("`sample = false`, or no `axis_weight`");
        }
    }

    /// The weighted place of each output along the axis; `None` if places do not count.
    fn places(&self, layout: &Layout) -> Result<Option<Vec<f64>>, Stop> {
        let Some(weight) = self.axis_weight else { return Ok(None) };
        let series = Series::of(layout, self.along.as_deref()).map_err(Stop::new)?;
        let mut places = vec![0.0; layout.len()];
        for outputs in &series.outputs {
            outputs.iter().zip(&series.grid).for_each(|(&i, x)| places[i] = weight * x);
        }
        Ok(Some(places))
    }

    /// Unit of the distance.
    fn unit(&self, response: &Unit) -> Unit {
        match self.metric {
            Metric::Wasserstein => response.difference(),
            Metric::Energy => response.difference().power(0.5).unwrap_or_default(),
            Metric::MaximumMeanDiscrepancy | Metric::JensenShannon => Unit::dimensionless(),
        }
    }

    fn sets(&self, known: &Known<'_>, groups: &Groups, stream: &Stream) -> Result<Vec<Set>, Stop> {
        let places = self.places(&known.data.layout)?;
        let set = |g: usize| {
            let (mut outputs, mut values) = (Vec::new(), Vec::new());
            for replicate in &known.data.replicates {
                let own = replicate.values.iter().enumerate();
                for (i, value) in own.filter(|(i, _)| groups.of[*i] == Some(g)) {
                    outputs.extend(value.map(|_| i));
                    values.extend(*value);
                }
            }
            let coordinate = places.as_ref().map(|at| outputs.iter().map(|&i| at[i]).collect());
            let to_data = ToData::new(self.metric, coordinate, values, self.bandwidth)?;
            let size = (self.simulations, self.sample);
            Ok(Set::new(outputs, to_data, size, &stream.named("set").at(g as u64)))
        };
        (0..groups.count()).map(set).collect()
    }
}

impl Discrepancy for ApproximateBayesianComputation {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        let replicates = Replicates::of(known.data, known.common)?;
        let layout = &known.data.layout;
        let groups = Groups::of(layout, &self.distance_by).map_err(Stop::new)?;
        let groups = groups.with_data(&replicates.measured);
        let mut hyper = Vec::new();
        let name = Unknown { name: "tolerance", unit: self.unit(&layout.unit) };
        // An estimate would need the response; the prior's median is the start.
        let start = |_| f64::NAN;
        let tolerance = PerGroup::new(&self.tolerance, &groups, &name, start, &mut hyper);
        let by = (&self.variance, &self.by);
        let noise = Noise::new(known, known.data, &replicates, by, &mut hyper)?;
        let stream = Stream::root(0).named("distance");
        let sets = self.sets(known, &groups, &stream)?;
        let size = (self.simulations, layout.len());
        let common = common_draws(known.common, size, &stream.named("common"));
        let sample = self.sample;
        Ok(Box::new(Approximate { noise, replicates, hyper, tolerance, sets, common, sample }))
    }

    fn stochastic_model(&self) -> StochasticModel {
        StochasticModel::Taken
    }

    fn stated_noise(&self, layout: &Layout, _: &[f64]) -> Option<StatedNoise> {
        let sd = self.variance.known_sd(layout, &self.by).filter(|_| !self.sample)?;
        Some(StatedNoise { sd, correlation_time: None })
    }
}

lacuna::register!(Discrepancy, "approximate_bayesian_computation", ApproximateBayesianComputation, aliases: ["abc"]);
