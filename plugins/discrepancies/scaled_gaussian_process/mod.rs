//! `scaled_gaussian_process`: a smooth model bias that keeps the calibrated model close to the data.

mod bias;
#[cfg(test)]
mod tests;

use lacuna::data::{Layout, Measurements};
use lacuna::plugin::component::{Component, Context};
use lacuna::plugin::discrepancy::{Discrepancy, Known, Likelihood, StatedNoise};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{
    Biased, By, Correlation, Dense, PerGroup, Quantity, Smooth, SmoothBias, Unknown, Variance,
    loses_an_output,
};
use bias::{ScaledBias, Scaling};

/// A smooth bias of the model whose mean square is kept small, plus independent normal noise.
///
/// With a Gaussian process as bias the calibrated model itself, without its bias, can be far from the data: the process
/// prefers a large smooth bias to a small rough one. The scaled process (S-GaSP; Gu and Wang, SIAM/ASA J. Uncertainty
/// Quantification 6 (2018) 1555) has the prior of a Gaussian process of variance `s²` times `exp(-λ Z / (2 s²))`, with
/// `Z` the mean square of the bias over the `n` measured outputs of a series. It is a Gaussian process again, with the
/// covariance
///
/// ```text
/// s² (R - R (R + n/λ I)⁻¹ R)
/// ```
///
/// at these outputs, `R` the correlations. Without `λ` it is the Gaussian process; with a large one the estimates are
/// those of least squares. Choose it if the calibrated model will be used without its bias; if the true values of
/// physical parameters are wanted, state knowledge with `constrained_gaussian_process`.
///
/// The variance of a new replicate is reported as `measurement` (the noise), `model_form` (the prior variance of the
/// bias), and the common errors. The covariance is dense: the cost of an evaluation grows with the cube of the number
/// of measured outputs. Up to a few hundred are practical.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScaledGaussianProcess {
    /// Standard deviation `s` of the bias before it is scaled, in the unit of the response: a prior such as
    /// `{ half_normal = 1e-5 }`, or `{ known = 1e-5 }`. Unknown ones are named `bias`, or `bias[B]`.
    pub bias: Quantity,
    /// Correlation length of the bias, in the unit of the axis: a prior such as `{ log_normal = [-9.2, 0.7] }`, or
    /// `{ known = 1e-4 }`. Unknown ones are named `correlation_length`, or `correlation_length[B]`.
    pub correlation_length: Quantity,
    /// Scaling parameter `λ`: `{ known = 1000 }`, or a prior; unknown ones are named `scaling`, or `scaling[B]`. Default:
    /// `100 √n`, as in the numerical examples of Gu, Xie and Wang (SIAM/ASA J. Uncertainty Quantification 10 (2022)
    /// 1435), where the estimates converge to those of least squares if `λ` grows as `√n`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scaling: Option<Quantity>,
    /// Groups of series with a common standard deviation, correlation length and scaling of the bias: `"all"`, or one
    /// per value of another axis than the one they run along, such as `"sensor"`.
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

impl Component for ScaledGaussianProcess {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let smooth = self.smooth().check(context, complaints);
        if let Some(scaling) = &self.scaling {
            let groups = smooth.map_or(1, |(_, groups)| groups);
            scaling.check_positive("scaling", groups, complaints);
        }
    }
}

impl ScaledGaussianProcess {
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

    /// Builds the likelihood of `known.data`, with measured variances taken from the replicates of `shown`.
    fn under(&self, known: &Known<'_>, shown: &Measurements) -> Result<Biased<ScaledBias>, Stop> {
        let smooth = self.smooth();
        let mut own = smooth.unknowns(known, 0.1)?;
        let name = Unknown { name: "scaling", unit: lacuna::data::Unit::dimensionless() };
        let root = 100.0 * (own.replicates.measured.len() as f64).sqrt();
        let scaling = match &self.scaling {
            None => Scaling::Root,
            Some(known) => {
                Scaling::Stated(PerGroup::new(known, &own.groups, &name, |_| root, &mut own.hyper))
            }
        };
        let noise = smooth.noise(known, shown, &mut own)?;
        let SmoothBias { replicates, series, groups, sd, length, hyper } = own;
        let factor = replicates.common_factor(known.common)?;
        let dense = Dense::new(replicates, factor, known.data.layout.len());
        let bias =
            ScaledBias::new(self.kernel, &series, &dense.place, &groups, (sd, length, scaling));
        Ok(Biased { noise, hyper, dense, bias })
    }
}

impl Discrepancy for ScaledGaussianProcess {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        Ok(Box::new(self.under(known, known.data)?))
    }

    /// The prior depends on the measured outputs: there is no such form if one is measured only in all of the data.
    fn likelihood_of_part(
        &self,
        known: &Known<'_>,
        part: &Measurements,
    ) -> Result<Option<Box<dyn Likelihood>>, Stop> {
        if loses_an_output(part, known.data) {
            return Ok(None);
        }
        let known_part = Known { data: part, ..*known };
        Ok(Some(Box::new(self.under(&known_part, known.data)?)))
    }

    fn stated_noise(&self, layout: &Layout, _: &[f64]) -> Option<StatedNoise> {
        self.smooth().stated_noise(layout)
    }
}

lacuna::register!(Discrepancy, "scaled_gaussian_process", ScaledGaussianProcess, aliases: ["s_gasp"]);
