//! The keys of a comparison with held-out data.

use schemars::JsonSchema;
use serde::Serialize;

use super::BeforeAfter;
use crate::gap::experiment::hold_out::HeldOutKind;
use crate::gap::prove::{Closing, Comparison};
use crate::gap::result::HeldOut as Compared;
use crate::report::summary::value::{ByName, Quantity};

/// Comparison with held-out data, without and with the effects.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct HeldOut {
    /// Kind of data that were held out.
    pub kind: HeldOutKind,
    /// Names of the parts that were held out.
    pub names: Vec<String>,
    /// Number of replicates that were held out.
    pub count: usize,
    /// Size of the gap.
    #[serde(flatten)]
    pub gap: GapSize,
    /// Size of the gap without the part that the known errors of emulator and numerics could explain.
    pub beyond_known_errors: GapSize,
    /// True if the gap shrank: the lower bound of the closed share is above zero, and no condition became significantly
    /// worse.
    pub shrank: bool,
    /// Root mean square difference between the calibrated response and the mean of the replicates, in the unit of the
    /// response.
    pub rmse: BeforeAfter,
    /// Share of held-out values inside the 95 % predictive band of a replicate.
    pub coverage: BeforeAfter,
    /// Share of outputs inside the 95 % interval of the held-out replicates, mean over the groups; `null` below two
    /// replicates.
    pub accuracy: Option<BeforeAfter>,
    /// Log predictive density of the held-out values with the effects, minus that without.
    pub log_score: Quantity,
    /// Size of the gap in each scenario.
    #[schemars(extend("propertyNames" = { "title": "scenario" }))]
    pub conditions: ByName<GapSize>,
}

/// Size of the gap without and with the effects.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct GapSize {
    /// Gap without the effects, in standard deviations of the noise.
    pub before: Quantity,
    /// Gap with the effects, in standard deviations of the noise.
    pub after: Quantity,
    /// Closed share of the squared gap.
    pub closed: Quantity,
    /// Lower end of the 95 % interval of that share.
    pub lower: f64,
    /// Upper end of the 95 % interval of that share.
    pub upper: f64,
}

impl HeldOut {
    pub fn of(part: &Compared) -> Self {
        let proof = &part.proof;
        let conditions = proof.conditions.iter().filter_map(|condition| {
            Some((condition.scenario.clone()?, GapSize::of(&condition.comparison)))
        });
        Self {
            kind: part.kind,
            names: part.names.clone(),
            count: proof.all.replicates,
            gap: GapSize::of(&proof.all),
            beyond_known_errors: GapSize::beyond_known_errors(&proof.all),
            shrank: proof.shrank,
            rmse: BeforeAfter::of(proof.rmse),
            coverage: BeforeAfter::of(proof.coverage),
            accuracy: part.accuracy.map(BeforeAfter::of),
            log_score: proof.log_score.into(),
            conditions: conditions.collect(),
        }
    }
}

impl GapSize {
    fn of(c: &Comparison) -> Self {
        Self {
            before: c.before.into(),
            after: c.after.into(),
            closed: c.closed.into(),
            lower: c.lower,
            upper: c.upper,
        }
    }

    fn beyond_known_errors(all: &Comparison) -> Self {
        let Closing { before, after, closed: [closed, lower, upper] } = all.beyond_known_errors;
        Self { before: before.into(), after: after.into(), closed: closed.into(), lower, upper }
    }
}
