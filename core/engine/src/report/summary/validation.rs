//! The keys of the validation: comparison of the calibrated simulation with the data.

use schemars::JsonSchema;
use serde::Serialize;

use super::value::{ByName, Quantity};
use crate::stage::validate::{ValidationCase, ValidationFindings};

/// Entry of [`Accuracy`] that is the mean over the groups.
const AVERAGE: &str = "average";

/// The keys that a validation adds to the summary.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Validation {
    /// Share of points inside the 95 % interval of the replicates, at the MAP (`map`) and at the reference
    /// (`reference`).
    #[schemars(extend("propertyNames" = { "title": "case" }))]
    pub accuracy: ByName<Accuracy>,
    /// Root mean square difference between the response and the mean of the replicates, in the unit of the response.
    #[schemars(extend("propertyNames" = { "title": "case" }))]
    pub rmse: ByName<Quantity>,
    /// True if the model was run at the parameters of the case; false if the emulator was used.
    #[schemars(extend("propertyNames" = { "title": "case" }))]
    pub simulated: ByName<bool>,
    /// Standard deviation of a new replicate by origin, root mean square over outputs, in the unit of the response.
    #[schemars(extend("propertyNames" = { "title": "origin" }))]
    pub spread: ByName<f64>,
}

/// Share of points inside the 95 % interval of the replicates.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
// The documentation of a flattened map is lost, so it is repeated here.
#[schemars(extend(
    "propertyNames" = { "title": "group" },
    "additionalProperties" = {
        "$ref": "#/$defs/Quantity",
        "description": "Share of the points of the group (sensor).",
    }
))]
pub struct Accuracy {
    /// Share of points of each group.
    #[serde(flatten)]
    pub groups: ByName<Quantity>,
    /// Mean over the groups; `null` with one replicate, which has no interval.
    pub average: Option<Quantity>,
}

impl Validation {
    pub fn of(found: &ValidationFindings) -> Self {
        let cases = &found.cases;
        Self {
            accuracy: by_case(cases, Accuracy::of),
            rmse: by_case(cases, |case| case.rmse.into()),
            simulated: by_case(cases, |case| case.simulated),
            spread: found.spread.iter().cloned().collect(),
        }
    }
}

impl Accuracy {
    fn of(case: &ValidationCase) -> Self {
        let groups = case.accuracy.iter().filter(|(group, _)| group != AVERAGE);
        Self {
            groups: groups.map(|(group, share)| (group.clone(), Quantity(*share))).collect(),
            average: (!case.accuracy.is_empty()).then_some(Quantity(case.average)),
        }
    }
}

fn by_case<T>(cases: &[ValidationCase], value: impl Fn(&ValidationCase) -> T) -> ByName<T> {
    cases.iter().map(|case| (case.name.clone(), value(case))).collect()
}
