//! The keys of probabilities of rare events.

use schemars::JsonSchema;
use serde::Serialize;

use super::value::{ByName, Quantity};
use crate::report::findings::RareEvent;

/// Probability that a quantity of interest exceeds a limit. It contains the distribution of the parameters, and the errors of
/// emulator and numerics that the quantity includes; not those of the model's form and of measurements.
#[allow(clippy::struct_field_names, reason = "the keys of the summary")]
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Probability {
    /// Name of the quantity.
    pub quantity: String,
    /// Limit, in the unit of the quantity.
    pub limit: Quantity,
    /// `above` if the event is a value above the limit, `below` if it is one below.
    pub side: String,
    /// Unit of the quantity and the limit.
    pub unit: String,
    /// Distribution of the parameters: `prior` or `posterior`.
    pub distribution: String,
    /// Name of the method.
    pub method: String,
    /// Probability.
    pub probability: Quantity,
    /// Reliability index: minus the standard normal quantile of the probability.
    pub index: Quantity,
    /// Coefficient of variation of the estimate; absent for an approximation without sampling.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub variation: Option<f64>,
    /// 95 % interval of the estimate; absent for an approximation without sampling.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval: Option<[f64; 2]>,
    /// Number of calls of the model, or of the emulator.
    pub calls: usize,
    /// Number of calls without an answer; they count as no failure.
    pub undefined: usize,
    /// Number of standard normal variables of the errors of emulator and numerics, besides those of the parameters.
    pub error_variables: usize,
    /// Number of calls at which the limit was exceeded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failures: Option<usize>,
    /// True if the criteria of the method are met.
    pub converged: bool,
    /// Most probable points of the failure region, the nearest first.
    pub design_points: Vec<DesignPoint>,
    /// Sentences on what makes the estimate doubtful.
    pub warnings: Vec<String>,
}

/// Most probable point of the failure region.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct DesignPoint {
    /// Distance from the origin of the standard normal space.
    pub distance: Quantity,
    /// Parameters, in their units.
    #[schemars(extend("propertyNames" = { "title": "parameter" }))]
    pub values: ByName<Quantity>,
    /// Share of each parameter in the variance of the linearised limit state.
    #[schemars(extend("propertyNames" = { "title": "parameter" }))]
    pub importance: ByName<Quantity>,
    /// Share of the errors of emulator and numerics in this variance; absent without them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_importance: Option<Quantity>,
}

/// Probabilities by their names.
pub fn by_name(found: &[RareEvent]) -> ByName<Probability> {
    found.iter().map(|event| (event.name.clone(), Probability::of(event))).collect()
}

impl Probability {
    fn of(event: &RareEvent) -> Self {
        let named = |pairs: &[(String, f64)]| -> ByName<Quantity> {
            pairs.iter().map(|(name, value)| (name.clone(), Quantity(*value))).collect()
        };
        let points = event.design_points.iter().map(|point| DesignPoint {
            distance: point.distance.into(),
            values: named(&point.values),
            importance: named(&point.importance),
            error_importance: (event.error_variables > 0).then(|| point.error_importance.into()),
        });
        Self {
            quantity: event.quantity.clone(),
            limit: event.limit.into(),
            side: if event.above { "above" } else { "below" }.to_owned(),
            unit: event.unit.clone(),
            distribution: event.distribution.clone(),
            method: event.method.clone(),
            probability: event.probability.into(),
            index: event.index().into(),
            variation: event.variation,
            interval: event.interval,
            calls: event.calls,
            undefined: event.undefined,
            error_variables: event.error_variables,
            failures: event.failures,
            converged: event.converged,
            design_points: points.collect(),
            warnings: event.warnings.clone(),
        }
    }
}
