//! `constrained_gaussian_process`: a smooth model bias about which something is known, and independent noise.

mod draws;
mod knowledge;
mod likelihood;
mod orthant;
mod prior;
#[cfg(test)]
mod tests;

use lacuna::data::{Layout, Measurements};
use lacuna::plugin::component::{Component, Context};
use lacuna::plugin::discrepancy::{Discrepancy, Known, Likelihood, StatedNoise};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{By, Correlation, Quantity, Smooth, Variance};
use likelihood::ConstrainedLikelihood;

pub use knowledge::{KnownPoint, Monotone, Sign};

/// A smooth bias of the model of which values, slopes, sign or direction are known, plus independent normal noise.
///
/// As `gaussian_process`, with knowledge about the bias in place of orthogonality (Brynjarsdóttir and O'Hagan, Inverse
/// Problems 30 (2014) 114007). Without knowledge a bias can take the place of the parameters, and an orthogonal one
/// defines the parameters as those of the best fit. If the true values of physical parameters are wanted, state what is
/// known about the error of the model: that it vanishes at some place, or that a neglected loss only grows.
///
/// - `known` are values and slopes at places, also outside of the data. The process is conditioned on them exactly.
/// - `sign` and `monotone` hold at `places` along the axis, each in the sense of a probit factor: the bias or its slope,
///   plus a normal error of a thousandth of its prior standard deviation, is not negative (Riihimäki and Vehtari, Proc.
///   AISTATS 9 (2010) 645). The likelihood contains the quotient of the probabilities of these conditions after and
///   before the data, both by quasi-Monte Carlo integration on fixed points (Genz, J. Computational and Graphical
///   Statistics 1 (1992) 141). The second depends on the correlation length, so that an evidence without it would be
///   wrong.
///
/// The variance of a new replicate is reported as `measurement` (the noise), `model_form` (the mean square of the bias
/// under its prior, which has a mean unlike zero), and the common errors. The covariance is dense: the cost of an
/// evaluation grows with the cube of the number of measured outputs. Up to a few hundred are practical.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConstrainedGaussianProcess {
    /// Standard deviation of the bias before anything is known about it, in the unit of the response: a prior such as
    /// `{ half_normal = 1e-5 }`, or `{ known = 1e-5 }`. Unknown ones are named `bias`, or `bias[B]`.
    pub bias: Quantity,
    /// Correlation length of the bias, in the unit of the axis: a prior such as `{ log_normal = [-9.2, 0.7] }`, or
    /// `{ known = 1e-4 }`. Unknown ones are named `correlation_length`, or `correlation_length[B]`.
    pub correlation_length: Quantity,
    /// Known values and slopes of the bias, such as `[{ at = 0, value = 0, slope = 0 }]`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub known: Vec<KnownPoint>,
    /// Sign of the bias (data minus model), if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sign: Option<Sign>,
    /// Direction in which the bias changes along the axis, if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub monotone: Option<Monotone>,
    /// Number of places along the axis, at equal distances, at which sign and direction hold. More places than the range
    /// has correlation lengths, times three, change little.
    #[serde(default = "eight")]
    pub places: usize,
    /// First and last of these places. Default: those of the axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub between: Option<[f64; 2]>,
    /// Groups of series with a common standard deviation and correlation length of the bias: `"all"`, or one per
    /// value of another axis than the one they run along, such as `"sensor"`.
    #[serde(default)]
    pub bias_by: By,
    /// Smoothness of the bias.
    #[serde(default)]
    pub kernel: Correlation,
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

fn eight() -> usize {
    8
}

impl ConstrainedGaussianProcess {
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

impl Component for ConstrainedGaussianProcess {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if let Some((series, _)) = self.smooth().check(context, complaints) {
            knowledge::check(self, &series, complaints);
        }
    }
}

impl Discrepancy for ConstrainedGaussianProcess {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        Ok(Box::new(ConstrainedLikelihood::under(self, known, known.data)?))
    }

    fn likelihood_of_part(
        &self,
        known: &Known<'_>,
        part: &Measurements,
    ) -> Result<Option<Box<dyn Likelihood>>, Stop> {
        let known_part = Known { data: part, ..*known };
        Ok(Some(Box::new(ConstrainedLikelihood::under(self, &known_part, known.data)?)))
    }

    fn stated_noise(&self, layout: &Layout, _: &[f64]) -> Option<StatedNoise> {
        self.smooth().stated_noise(layout)
    }
}

lacuna::register!(Discrepancy, "constrained_gaussian_process", ConstrainedGaussianProcess);
