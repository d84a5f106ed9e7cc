//! `gaussian`: independent normal differences.

mod compressed;
mod grams;
mod integral;
mod law;
mod likelihood;
mod memory;
mod stated;
mod statistics;
#[cfg(test)]
mod tests;

use lacuna::data::{Layout, Measurements};
use lacuna::plugin::component::{Component, Context};
use lacuna::plugin::discrepancy::{Discrepancy, Known, Likelihood, StatedNoise};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{By, Groups, Variance};
use likelihood::GaussianLikelihood;
use stated::StatedLikelihood;

/// Independent normal differences between data and model, with one variance or one for each group of outputs.
///
/// Every measured value is the model's response plus a normal number with zero mean. Its variance is known or
/// unknown, and the same for all outputs (homoscedastic; Radaideh et al. arXiv 2202.03959, equation of the
/// likelihood), by sensor or by time window, as `variance` and `by` say. Errors common to all replicates, such as the
/// emulator's, are further normal errors that are correlated between outputs: their covariance is added once to that
/// of the mean curve.
///
/// The likelihood uses count, mean and scatter of the replicates of each output, which are sufficient statistics;
/// with a linear emulator it is reduced further, by an orthogonal factorisation, to the size of the emulator's basis.
/// Both are exact.
///
/// **Measurements that state their own noise** (a column `sigma`, or a `covariance`): with
/// `variance = { measured = { known = 1 } }` the stated noise is taken as it is, which is generalised least squares;
/// with an unknown multiplier, such as `{ measured = { inverse_gamma = [102, 103] } }`, the stated variances are
/// correct up to one factor; any other `variance`, known or unknown, is added to the stated one, for errors that the
/// statement or the model leaves out. With a `covariance` all outputs must share one variance, and errors common to the
/// replicates are not estimated from them.
///
/// The variance of a new replicate is reported in parts: `measurement` is the variance between the replicates of the
/// group, `model_form` the rest, `emulator` and others are the common errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gaussian {
    /// Variance. An unknown one has a prior in the squared unit of the response, such as `{ half_normal = 1e-6 }`,
    /// `{ uniform = [0, 1e-8] }`, `{ inverse_gamma = [2, 1e-10] }` or `{ log_uniform = [1e-14, 1e-6] }`; it is sampled
    /// as its logarithm, with the Jacobian, so that the prior keeps its meaning. A known one is `{ known = 2.5e-11 }`.
    /// With `{ measured = { inverse_gamma = [102, 103] } }` the variance of each output is the variance between its
    /// replicates times an unknown `multiplier` (the error multipliers of Dakota, with a prior whose mean and mode are
    /// about 1); with `{ measured = { known = 1 } }` it is the measured variance itself. An output with fewer than two
    /// different values takes the measured variance of its group. If the measurements state their noise, `measured` is
    /// the stated variance, and any other variance is added to it.
    pub variance: Variance,
    /// Groups of outputs with a common variance or multiplier: `"all"`; `"sensor"` or another axis, one for each of
    /// its values; `["sensor", { axis = "time", windows = 5 }]`, one for each sensor and time window. The unknowns
    /// are named `variance[B]`, `variance[B, 0.0002..0.0004 s]` (first and last value in the window). A group without
    /// measurements has no variance.
    #[serde(default)]
    pub by: By,
    /// If true, unknown variances are integrated out of the likelihood and not sampled: in closed form for an inverse
    /// gamma prior without common errors, otherwise by quadrature to ten digits. One variance can always be
    /// integrated out, several only without common errors. Predictions then use the mean of the variance given the
    /// data.
    #[serde(default)]
    pub marginal: bool,
}

impl Component for Gaussian {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.by.check("by", context.layout, complaints);
        self.variance.check(Groups::of(context.layout, &self.by).ok().as_ref(), complaints);
        if self.marginal && self.variance.prior().is_none() {
            complaints
                .at("marginal")
                .say("a known variance cannot be integrated out")
                .help("leave out `marginal`, or give the variance a prior");
        }
        let several = Groups::of(context.layout, &self.by).is_ok_and(|g| g.count() > 1);
        if self.marginal && several && context.common_errors {
            complaints
                .at("marginal")
                .say(likelihood::SEVERAL)
                .expected("`marginal = false`, or one variance for all outputs (`by = \"all\"`)");
        }
    }
}

impl Discrepancy for Gaussian {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        if stated::is_needed(self, known.data) {
            return Ok(Box::new(StatedLikelihood::new(self, known)?));
        }
        Ok(Box::new(GaussianLikelihood::new(self, known)?))
    }

    fn likelihood_of_part(
        &self,
        known: &Known<'_>,
        part: &Measurements,
    ) -> Result<Option<Box<dyn Likelihood>>, Stop> {
        let known_part = Known { data: part, ..*known };
        if stated::is_needed(self, known.data) {
            return Ok(Some(Box::new(StatedLikelihood::new(self, &known_part)?)));
        }
        let likelihood = GaussianLikelihood::under(self, &known_part, known.data)?;
        Ok(Some(Box::new(likelihood)))
    }

    fn takes_stated_noise(&self) -> bool {
        true
    }

    fn stated_noise(&self, layout: &Layout, _: &[f64]) -> Option<StatedNoise> {
        let sd = self.variance.known_sd(layout, &self.by)?;
        Some(StatedNoise { sd, correlation_time: None })
    }
}

lacuna::register!(Discrepancy, "gaussian", Gaussian, aliases: ["normal", "iid", "least_squares"]);
