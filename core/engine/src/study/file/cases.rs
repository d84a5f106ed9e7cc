//! The engine's keys of `[cases]`.

use lacuna_run::Stage;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Work whose cases are computed by the executor of `[cases]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CasesOf {
    /// The truths of `lacuna coverage`.
    Coverage,
    /// The simulated data sets of `lacuna power`.
    Power,
    /// The searches of the surrogate: of the terms or length scales of each output or component.
    Surrogate,
}

impl CasesOf {
    /// The stage to which the cases belong.
    pub fn stage(self) -> Stage {
        match self {
            Self::Coverage => Stage::Coverage,
            Self::Power => Stage::Power,
            Self::Surrogate => Stage::Surrogate,
        }
    }
}

/// The engine's keys of `[cases]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct CasesKeys {
    /// Work whose cases are computed there; that of the others stays in the process that was started. `surrogate` pays for
    /// fits that take minutes: Gaussian processes of thousands of runs, with many outputs or components.
    /// The fit of a study with parameters by group stays in the process.
    pub of: Vec<CasesOf>,
}

impl Default for CasesKeys {
    fn default() -> Self {
        Self { of: vec![CasesOf::Coverage, CasesOf::Power] }
    }
}

impl CasesKeys {
    /// Returns true if the cases of a stage are computed there.
    pub fn include(&self, stage: Stage) -> bool {
        self.of.iter().any(|of| of.stage() == stage)
    }
}
