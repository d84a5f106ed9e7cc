//! `gaussian_process`: a smooth model bias, and independent noise.

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
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{By, Quantity, Smooth, Variance};
use likelihood::BiasedLikelihood;

pub use kernel::Kernel;

/// A smooth bias of the model, the same in all replicates, plus independent normal noise.
///
/// A measured value is the model's response, plus a bias that is a smooth random function along an axis (of time,
/// say, with a separate function for each sensor), plus noise of the given `variance` that is independent in each
/// replicate (Kennedy and O'Hagan, J. Royal Statistical Society B 63 (2001) 425). The bias is a Gaussian process with
/// zero mean and a Matérn covariance. Averaging over replicates reduces the noise, but not the bias. Choose this
/// discrepancy if the model deviates from the data systematically.
///
/// A bias that can imitate the effects of the parameters on the response makes the parameters unidentifiable. With
/// `orthogonal = true` its prior is conditioned to be orthogonal to the derivatives of the response with respect to
/// the parameters at the best fit, over all measured outputs (Plumlee, J. American Statistical Association 112 (2017)
/// 1274): whatever the parameters can explain is attributed to them. The covariance `C` becomes
/// `C - C G (G'CG)^-1 G'C` with `G` the derivatives.
///
/// The variance of a new replicate is reported as `measurement` (the noise), `model_form` (the prior variance of the
/// bias), and the common errors. The process is Markov in its derivatives, so that a Kalman filter factors the
/// covariance of a series at a cost proportional to its length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GaussianProcess {
    /// Standard deviation of the bias, in the unit of the response: a prior such as `{ half_normal = 1e-5 }`, or
    /// `{ known = 1e-5 }`. Unknown ones are named `bias`, or `bias[B]`.
    pub bias: Quantity,
    /// Correlation length of the bias, in the unit of the axis: a prior such as `{ log_normal = [-9.2, 0.7] }`, or
    /// `{ known = 1e-4 }`. Unknown ones are named `correlation_length`, or `correlation_length[B]`.
    pub correlation_length: Quantity,
    /// Groups of series with a common standard deviation and correlation length of the bias: `"all"`, or one per
    /// value of another axis than the one they run along, such as `"sensor"`.
    #[serde(default)]
    pub bias_by: By,
    /// Smoothness of the bias.
    #[serde(default)]
    pub kernel: Kernel,
    /// If true, the bias is orthogonal to the effects of the parameters on the response, so that it cannot take their
    /// place.
    #[serde(default = "yes")]
    pub orthogonal: bool,
    /// Name of the numeric axis along which the bias is smooth. Default: the last numeric axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub along: Option<String>,
    /// Variance of the noise, in the squared unit of the response: a prior such as `{ half_normal = 1e-6 }`,
    /// `{ known = 2.5e-11 }`, or a multiple of the measured variance, `{ measured = { known = 1 } }`, as for
    /// `gaussian`.
    pub variance: Variance,
    /// Groups of outputs with a common variance of the noise: `"all"`, one per value of an axis such as `"sensor"`,
    /// windows of an axis, or a list of these.
    #[serde(default)]
    pub by: By,
}

fn yes() -> bool {
    true
}

impl GaussianProcess {
    fn smooth(&self) -> Smooth<'_> {
        Smooth {
            bias: &self.bias,
            correlation_length: &self.correlation_length,
            bias_by: &self.bias_by,
            along: self.along.as_deref(),
            variance: &self.variance,
            by: &self.by,
        }
    }
}

impl Component for GaussianProcess {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.smooth().check(context, complaints);
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
        self.smooth().stated_noise(layout)
    }
}

lacuna::register!(Discrepancy, "gaussian_process", GaussianProcess, aliases: ["gp", "koh", "kennedy_ohagan"]);
