//! The keys of predicted quantities.

use schemars::JsonSchema;
use serde::Serialize;

use super::bounds::QuantityBounds;
use super::value::{ByName, Quantity};
use crate::report::findings::{BoundsFindings, InputShare, QuantityFindings};

/// Prediction of one quantity of interest. Mean, standard deviation and quantiles contain the posterior of the parameters,
/// in a study without measurements their priors, and the errors in `includes`.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PredictedQuantity {
    /// Mean of the prediction.
    pub mean: Quantity,
    /// Standard deviation of the prediction.
    pub sd: f64,
    /// 2.5 % quantile of the prediction.
    pub q025: f64,
    /// Median of the prediction.
    pub median: f64,
    /// 97.5 % quantile of the prediction.
    pub q975: f64,
    /// Value at the maximum of the posterior density, without errors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub map: Option<Quantity>,
    /// Value at the medians of the priors, without errors, in a study without measurements.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_medians: Option<Quantity>,
    /// Monte Carlo standard error of the mean.
    pub mcse_mean: f64,
    /// Shares of the inputs in the variance without errors, in a study without measurements.
    #[serde(skip_serializing_if = "ByName::is_empty")]
    #[schemars(extend("propertyNames" = { "title": "input" }))]
    pub sensitivity: ByName<Share>,
    /// Bounds over the intervals of parameters, in a study without measurements that has some. All other numbers are then
    /// those with these parameters at the middle of their intervals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bounds: Option<QuantityBounds>,
    /// Prediction with the distribution of the parameters alone, without any error.
    pub parameters: OfParameters,
    /// Standard deviation of the prediction with all sources of uncertainty but one; a source that the quantity does not
    /// depend on is absent.
    #[schemars(extend("propertyNames" = { "title": "source" }))]
    pub without: ByName<f64>,
    /// Origins of the errors in the prediction.
    pub includes: Vec<String>,
    /// Origins of errors that a new replicate has and the prediction does not contain.
    pub leaves_out: Vec<String>,
    /// Number of posterior draws of the prediction.
    pub draws: usize,
    /// Number of those draws at which the quantity is undefined; all numbers are those of the others.
    pub undefined: usize,
    /// Unit of all numbers.
    pub unit: String,
    /// Reference value, if the study gives one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<Quantity>,
}

/// Share of an input in the variance of a quantity; null if the quantity does not vary.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Share {
    /// First-order Sobol index: the share that disappears when the input becomes known, on average.
    pub first_order: Quantity,
    /// Standard error of `first_order`.
    pub first_order_error: f64,
    /// Total Sobol index: the share that is left when all other inputs are known, on average.
    pub total: Quantity,
    /// Standard error of `total`.
    pub total_error: f64,
    /// Shapley effect: the share when interactions are divided equally; the effects of all inputs add up to one.
    pub shapley: Quantity,
    /// Standard error of `shapley`.
    pub shapley_error: f64,
}

/// Prediction with the distribution of the parameters alone.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct OfParameters {
    /// Mean.
    pub mean: Quantity,
    /// Standard deviation.
    pub sd: f64,
    /// 2.5 % quantile.
    pub q025: f64,
    /// Median.
    pub median: f64,
    /// 97.5 % quantile.
    pub q975: f64,
}

/// Predicted quantities by their names; `bounds` is what they were bounded over.
pub fn by_name(
    found: &[QuantityFindings],
    bounds: Option<&BoundsFindings>,
) -> ByName<PredictedQuantity> {
    let one = |q: &QuantityFindings| (q.name.clone(), PredictedQuantity::of(q, bounds));
    found.iter().map(one).collect()
}

impl PredictedQuantity {
    fn of(found: &QuantityFindings, bounds: Option<&BoundsFindings>) -> Self {
        let (total, parameters) = (found.total, found.parameters);
        Self {
            mean: total.mean.into(),
            sd: total.sd,
            q025: total.q025,
            median: total.median,
            q975: total.q975,
            map: (!found.of_priors).then(|| found.map.into()),
            at_medians: found.of_priors.then(|| found.map.into()),
            sensitivity: found.shares.iter().map(|s| (s.name.clone(), Share::of(s))).collect(),
            mcse_mean: found.mcse_mean,
            bounds: found
                .bounds
                .as_ref()
                .zip(bounds)
                .map(|(own, all)| QuantityBounds::of(own, all)),
            parameters: OfParameters {
                mean: parameters.mean.into(),
                sd: parameters.sd,
                q025: parameters.q025,
                median: parameters.median,
                q975: parameters.q975,
            },
            without: found.without.iter().cloned().collect(),
            includes: found.includes.clone(),
            leaves_out: found.leaves_out.clone(),
            draws: found.draws,
            undefined: found.undefined,
            unit: found.unit.clone(),
            reference: found.reference.map(Quantity),
        }
    }
}

impl Share {
    fn of(found: &InputShare) -> Self {
        Self {
            first_order: found.first.0.into(),
            first_order_error: found.first.1,
            total: found.total.0.into(),
            total_error: found.total.1,
            shapley: found.shapley.0.into(),
            shapley_error: found.shapley.1,
        }
    }
}
