//! `summary.json`: the results that scripts read.
//!
//! The structs of this folder define the file: a field is a key, and its doc comment is the entry of that key in
//! `docs/reference/summary.md` and in the JSON Schema ([`schema`]). A number that claims no uncertainty is a
//! [`Quantity`], any other an `f64`. A key whose field is skipped if it is `None` is absent if the run did not compute
//! it; other optional keys are `null`.

mod bounds;
mod fields;
mod gap;
mod inputs;
mod keys;
mod populations;
mod posterior;
mod quantities;
mod reliability;
mod schema;
mod surrogate;
mod validation;
mod value;

use schemars::JsonSchema;
use serde::Serialize;

use self::gap::Gap;
use self::inputs::{Data, Runs};
use self::posterior::Calibration;
use self::quantities::PredictedQuantity;
use self::reliability::Probability;
use self::surrogate::Surrogate;
use self::validation::Validation;
use super::findings::Findings;
use crate::assess::{Assessment, Finding, Severity};

pub use keys::{Key, keys};
pub use schema::{schema, schema_of};
pub use value::{ByName, Quantity};

/// Version of the keys and their meaning.
pub const SCHEMA: u64 = 1;

/// Results of a run of Lacuna, for scripts.
///
/// Numbers are in the units of the study and unrounded; a number that is not finite is `null`. A key is absent if the
/// run did not compute it.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[schemars(title = "Lacuna summary")]
pub struct Summary {
    /// Version of the keys and their meaning.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: u64,
    /// Name of the study.
    pub study: String,
    /// Title of the study.
    pub title: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Version of Lacuna that wrote the summary.
    pub version: String,
    /// Plugin that the study uses in each section; for example, `sampler` is `affine_invariant_ensemble`.
    #[schemars(extend("propertyNames" = { "title": "section" }))]
    pub components: ByName<String>,
    /// Assessment of whether the result can be trusted.
    pub assessment: Assessment,
    /// Warnings in words: the failures and reservations of the assessment, then the warnings of the run.
    pub warnings: Vec<String>,
    /// Simulation runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub runs: Option<Runs>,
    /// Measured data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data: Option<Data>,
    /// Surrogate and its errors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surrogate: Option<Surrogate>,
    /// The keys that a calibration adds.
    #[serde(flatten)]
    pub calibration: Option<Calibration>,
    /// The keys that a validation adds.
    #[serde(flatten)]
    pub validation: Option<Validation>,
    /// Predicted quantities of interest (`[[quantity]]`).
    #[serde(skip_serializing_if = "ByName::is_empty")]
    #[schemars(extend("propertyNames" = { "title": "name" }))]
    pub quantities: ByName<PredictedQuantity>,
    /// Probabilities of rare events (`[[reliability]]`).
    #[serde(skip_serializing_if = "ByName::is_empty")]
    #[schemars(extend("propertyNames" = { "title": "name" }))]
    pub reliability: ByName<Probability>,
    /// Result of the gap search (`lacuna gap STUDY`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gap: Option<Gap>,
    /// Wall-clock time in which the result of each stage was computed, in seconds.
    #[schemars(extend("propertyNames" = { "title": "stage" }))]
    pub seconds: ByName<Quantity>,
    /// Version of Lacuna that computed the result of each stage.
    #[schemars(extend("propertyNames" = { "title": "stage" }))]
    pub made_by: ByName<String>,
}

/// The content of `summary.json`.
pub fn summary(findings: &Findings) -> Summary {
    Summary {
        schema: SCHEMA,
        study: findings.study.clone(),
        title: findings.title.clone(),
        seed: findings.seed,
        version: findings.version.clone(),
        components: findings.components.iter().cloned().collect(),
        assessment: findings.assessment.clone(),
        warnings: warnings(findings),
        runs: findings.ensemble.as_ref().map(Runs::of),
        data: findings.measured.as_ref().map(Data::of),
        surrogate: findings.surrogate.as_ref().map(|found| Surrogate::of(findings, found)),
        calibration: findings.calibration.as_ref().map(|found| Calibration::of(findings, found)),
        validation: findings.validation.as_ref().map(Validation::of),
        quantities: quantities::by_name(
            &findings.quantities,
            findings.propagated.as_ref().and_then(|found| found.bounds.as_ref()),
        ),
        reliability: reliability::by_name(&findings.reliability),
        gap: findings.gap.as_ref().map(Gap::of),
        seconds: quantities(&findings.seconds),
        made_by: findings.made_by.iter().cloned().collect(),
    }
}

/// Failures and reservations in words, then the warnings of the run.
fn warnings(findings: &Findings) -> Vec<String> {
    let grave = findings.assessment.findings.iter().filter(|f| f.severity > Severity::Note);
    grave.map(Finding::sentence).chain(findings.warnings.iter().cloned()).collect()
}

fn quantities(pairs: &[(String, f64)]) -> ByName<Quantity> {
    pairs.iter().map(|(name, value)| (name.clone(), Quantity(*value))).collect()
}
