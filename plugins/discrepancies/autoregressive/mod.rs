//! `autoregressive`: normal differences that are correlated in time.

mod likelihood;
mod steps;
#[cfg(test)]
mod tests;

use lacuna::data::{Layout, Measurements};
use lacuna::plugin::component::{Component, Context};
use lacuna::plugin::discrepancy::{Discrepancy, Known, Likelihood, StatedNoise};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{By, Groups, Quantity, Series, Variance};
use likelihood::AutoregressiveLikelihood;

/// Normal differences that are correlated along an axis within each replicate: a first-order autoregressive process.
///
/// Within one replicate and one series (one sensor, say) the differences between data and model are a stationary
/// normal process of the given `variance`, with the correlation `exp(-|t - t'| / correlation_time)` between two times
/// (the Ornstein-Uhlenbeck process; in discrete time autoregressive of order one with the coefficient
/// `exp(-dt / correlation_time)`; Box and Jenkins, Time Series Analysis (1976), 3.2, and Jones, Technometrics 22 (1980)
/// 389 for gaps). Replicates and series are independent. Choose it if residuals at neighbouring times are similar
/// within each replicate; a deviation common to all replicates is described by `gaussian_process`.
///
/// Uneven grids and gaps are treated exactly: the distribution of a value depends only on the one measured before it.
/// Since it has the same form in all replicates that measured both, the likelihood uses counts, means, scatters and
/// co-scatters of such pairs. Errors common to all replicates enter once, as for `gaussian`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Autoregressive {
    /// Variance of a single value, in the squared unit of the response: a prior such as `{ half_normal = 1e-6 }`,
    /// `{ known = 2.5e-11 }`, or a multiple of the measured variance, `{ measured = { inverse_gamma = [3, 4] } }`, as
    /// for `gaussian`.
    pub variance: Variance,
    /// Groups of outputs with a common variance: `"all"`, one per value of an axis such as `"sensor"`, windows of an
    /// axis, or a list of these. More groups mean more unknowns.
    #[serde(default)]
    pub by: By,
    /// Correlation time: the distance over which correlations decrease by a factor of e, in the unit of the axis. A
    /// prior such as `{ log_uniform = [1e-6, 1e-3] }`, or `{ known = 5e-5 }`.
    pub correlation_time: Quantity,
    /// Groups of series with a common correlation time: `"all"`, or one per value of another axis than the one they
    /// run along, such as `"sensor"`.
    #[serde(default)]
    pub correlation_by: By,
    /// Name of the numeric axis along which differences are correlated. Default: the last numeric axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub along: Option<String>,
}

impl Component for Autoregressive {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let layout = context.layout;
        self.by.check("by", layout, complaints);
        self.variance.check(Groups::of(layout, &self.by).ok().as_ref(), complaints);
        self.correlation_by.check("correlation_by", layout, complaints);
        let groups = Groups::of(layout, &self.correlation_by).map_or(1, |g| g.count());
        self.correlation_time.check_positive("correlation_time", groups, complaints);
        match Series::of(layout, self.along.as_deref()) {
            Err(text) => {
                complaints.at("along").say(text);
            }
            Ok(series) if self.correlation_by.divides(&series.axis) => {
                complaints
                    .at("correlation_by")
                    .say("a correlation time applies to a whole series")
                    .expected(format!("another axis than `{}`", series.axis));
            }
            Ok(_) => {}
        }
    }
}

impl Discrepancy for Autoregressive {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        Ok(Box::new(AutoregressiveLikelihood::new(self, known)?))
    }

    fn likelihood_of_part(
        &self,
        known: &Known<'_>,
        part: &Measurements,
    ) -> Result<Option<Box<dyn Likelihood>>, Stop> {
        let known_part = Known { data: part, ..*known };
        let likelihood = AutoregressiveLikelihood::under(self, &known_part, known.data)?;
        Ok(Some(Box::new(likelihood)))
    }

    fn stated_noise(&self, layout: &Layout, _: &[f64]) -> Option<StatedNoise> {
        // A stated correlation time applies along the last axis, along which the values of a curve follow each other.
        let last = Series::of(layout, None).ok()?.axis;
        let sd = self.variance.known_sd(layout, &self.by)?;
        let times = self.correlation_time.known(layout, &self.correlation_by)?;
        let along_last = self.along.as_ref().is_none_or(|along| *along == last);
        along_last.then_some(StatedNoise { sd, correlation_time: Some(times) })
    }
}

lacuna::register!(Discrepancy, "autoregressive", Autoregressive, aliases: ["ar", "ar1"]);
