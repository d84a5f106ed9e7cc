//! `gaussian_process`: a smooth bias of the model, and independent noise.

mod bias;
mod filter;
mod kernel;
mod likelihood;
mod precision;
mod solve;
#[cfg(test)]
mod tests;

use lacuna::data::{Layout, Measurements};
use lacuna::plugin::component::{Component, Context};
use lacuna::plugin::discrepancy::{Discrepancy, Known, Likelihood, StatedNoise};
use lacuna::run::Stop;
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{By, Groups, Quantity, Series, Variance};
pub use kernel::Kernel;
use likelihood::BiasedLikelihood;

/// A smooth bias of the model, the same in all replicates, plus independent normal noise.
///
/// A measured value is the model's response, plus a bias that is a smooth random function along an
/// axis (of time, for each sensor its own), plus noise of the given `variance` that is new in each
/// replicate (Kennedy and O'Hagan, J. Royal Statistical Society B 63 (2001) 425). The bias is a
/// Gaussian process of mean zero with a Matérn covariance. Averaging over replicates makes the
/// noise smaller, but not the bias: this is how a study says that the model is wrong by more than
/// chance.
///
/// A bias that may take the shape of what the parameters do to the response leaves the parameters
/// unknown. With `orthogonal = true` its prior is conditioned to be orthogonal to the derivatives
/// of the response by the parameters at the best fit, over all measured outputs (Plumlee, J.
/// American Statistical Association 112 (2017) 1274): what the parameters can explain is explained
/// by them. The covariance `C` becomes `C - C G (G'CG)^-1 G'C` with `G` the derivatives.
///
/// The variance of a new replicate is told as `measurement` (the noise), `model_form` (the bias
/// before data), and the common errors. The process is Markov in its derivatives, so that a Kalman
/// filter factors the covariance of a series in operations proportional to its length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GaussianProcess {
    /// The standard deviation of the bias in the unit of the response: a prior such as
    /// `{ half_normal = 1e-5 }`, or `{ known = 1e-5 }`. Unknown ones are called `bias`, or
    /// `bias[B]`.
    pub bias: Quantity,
    /// The length over which the bias is correlated, in the unit of the axis: a prior such as
    /// `{ log_normal = [-9.2, 0.7] }`, or `{ known = 1e-4 }`. Unknown ones are called
    /// `correlation_length`, or `correlation_length[B]`.
    pub correlation_length: Quantity,
    /// Which series share the standard deviation and the length of their biases: `"all"`, or
    /// another axis than the one they run along, such as `"sensor"`.
    #[serde(default)]
    pub bias_by: By,
    /// How smooth the bias is.
    #[serde(default)]
    pub kernel: Kernel,
    /// Whether the bias is orthogonal to what the parameters do to the response.
    #[serde(default = "yes")]
    pub orthogonal: bool,
    /// The axis of numbers along which the bias is smooth; the last one when it is left away.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub along: Option<String>,
    /// The variance of the noise: a prior such as `{ half_normal = 1e-6 }`, `{ known = 2.5e-11 }`,
    /// or a multiple of the measured one, `{ measured = { known = 1 } }`, as for `gaussian`.
    pub variance: Variance,
    /// Which outputs share a variance of the noise: `"all"`, an axis such as `"sensor"`, windows,
    /// or a list of these.
    #[serde(default)]
    pub by: By,
}

fn yes() -> bool {
    true
}

impl Component for GaussianProcess {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let layout = context.layout;
        self.by.check("by", layout, complaints);
        self.variance.check(Groups::of(layout, &self.by).ok().as_ref(), complaints);
        self.bias_by.check("bias_by", layout, complaints);
        let groups = Groups::of(layout, &self.bias_by).map_or(1, |g| g.count());
        self.bias.check_positive("bias", groups, complaints);
        self.correlation_length.check_positive("correlation_length", groups, complaints);
        match Series::of(layout, self.along.as_deref()) {
            Err(text) => {
                complaints.at("along").say(text);
            }
            Ok(series) if self.bias_by.divides(&series.axis) => {
                complaints
                    .at("bias_by")
                    .say("a bias belongs to a whole series")
                    .expected(format!("another axis than `{}`", series.axis));
            }
            Ok(_) => {}
        }
    }
}

impl Discrepancy for GaussianProcess {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        Ok(Box::new(BiasedLikelihood::new(self, known)?))
    }

    fn likelihood_of_part(
        &self,
        known: &Known<'_>,
        part: &Measurements,
    ) -> Result<Option<Box<dyn Likelihood>>, Stop> {
        let known_part = Known { data: part, ..*known };
        let likelihood = BiasedLikelihood::under(self, &known_part, known.data)?;
        Ok(likelihood.map(|likelihood| Box::new(likelihood) as Box<dyn Likelihood>))
    }

    fn stated_noise(&self, layout: &Layout, _: &[f64]) -> Option<StatedNoise> {
        let sd = self.variance.known_sd(layout, &self.by)?;
        Some(StatedNoise { sd, correlation_time: None })
    }
}

lacuna::register!(Discrepancy, "gaussian_process", GaussianProcess, aliases: ["gp", "koh", "kennedy_ohagan"]);
