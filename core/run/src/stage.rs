//! Stages of a run: name, place in the run directory, and dependence of the artifacts on code.

use std::borrow::Cow;
use std::fmt;

/// A stage, in the order of the program.
///
/// The number of a folder gives its place among the stages of one run; stages with equal numbers do not depend on each
/// other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Chooses the points at which the model is run.
    Design,
    /// Runs the model at these points.
    Simulate,
    /// Reads runs and measurements.
    Read,
    /// Estimates the model's numerical error from runs with finer numerics.
    NumericalError,
    /// Fits an emulator to the runs.
    Surrogate,
    /// Samples the posterior.
    Calibrate,
    /// Estimates the evidence, and predicts held-out data.
    Evidence,
    /// Compares the response of the calibrated model with the data.
    Validate,
    /// Predicts the quantities of interest.
    Quantities,
    /// Estimates the probabilities of rare events.
    Reliability,
    /// Checks whether the result can be trusted.
    Assess,
    /// Searches for physics that is missing in the model.
    Gap,
    /// Compares a study with added effects with the study without them, on held-out data.
    Show,
    /// Estimates which effects the data could have revealed (power).
    Power,
    /// Counts how often intervals contain known truths (coverage).
    Coverage,
    /// Writes report page, summary and draws.
    Report,
}

/// Dependence of a stage's artifacts on code, besides its inputs; the number is the revision of the stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depends {
    /// No dependence: the points of a design are the same whatever code made them, and the runs are made at them.
    OnNothing,
    /// Dependence on the revisions of the stage and of its plugins. Runs are expensive and usually made by another
    /// simulator: a new version of Lacuna is no reason to repeat them.
    OnRevisions(u32),
    /// Dependence on the version of the program as well.
    OnVersion(u32),
}

impl Stage {
    /// All stages, in order.
    pub const ALL: [Self; 16] = [
        Self::Design,
        Self::Simulate,
        Self::Read,
        Self::NumericalError,
        Self::Surrogate,
        Self::Calibrate,
        Self::Evidence,
        Self::Validate,
        Self::Quantities,
        Self::Reliability,
        Self::Assess,
        Self::Gap,
        Self::Show,
        Self::Power,
        Self::Coverage,
        Self::Report,
    ];

    /// Number, label and dependence.
    const fn row(self) -> (u8, &'static str, Depends) {
        use Depends::{OnNothing, OnRevisions, OnVersion};
        match self {
            Self::Design => (1, "design", OnNothing),
            Self::Simulate => (2, "simulate", OnRevisions(1)),
            Self::Read => (3, "read", OnVersion(1)),
            Self::NumericalError => (3, "numerical-error", OnVersion(2)),
            Self::Surrogate => (4, "surrogate", OnVersion(5)),
            Self::Calibrate => (5, "calibrate", OnVersion(11)),
            Self::Evidence => (6, "evidence", OnVersion(7)),
            Self::Validate => (6, "validate", OnVersion(8)),
            Self::Quantities => (6, "quantities", OnVersion(3)),
            Self::Reliability => (6, "reliability", OnVersion(3)),
            Self::Assess => (6, "assess", OnVersion(12)),
            Self::Gap => (7, "gap", OnVersion(8)),
            Self::Show => (7, "show", OnVersion(1)),
            Self::Power => (7, "power", OnVersion(3)),
            Self::Coverage => (7, "coverage", OnVersion(3)),
            Self::Report => (8, "report", OnNothing),
        }
    }

    /// Number with which the names of its folders begin.
    pub const fn number(self) -> u8 {
        self.row().0
    }

    /// Label in progress messages, in the summary and in the names of its folders.
    pub const fn label(self) -> &'static str {
        self.row().1
    }

    /// Dependence of its artifacts on code.
    pub const fn depends(self) -> Depends {
        self.row().2
    }

    /// Folder of the stage, such as `2-simulate`.
    pub fn folder(self) -> Folder {
        self.named(format!("{}-{}", self.number(), self.label()))
    }

    /// A further folder of the stage, such as `2-simulate-finer`.
    pub fn part(self, part: &str) -> Folder {
        self.folder().part(part)
    }

    /// Folder of this stage when another stage uses it, such as `5-refine-1-simulate`.
    pub fn inside(self, other: Self, part: &str) -> Folder {
        self.named(format!("{}-{part}-{}", other.number(), self.label()))
    }

    fn named(self, name: impl Into<Cow<'static, str>>) -> Folder {
        Folder { stage: self, name: name.into() }
    }
}

/// A folder of a run directory in which a stage keeps an artifact.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folder {
    stage: Stage,
    name: Cow<'static, str>,
}

impl Folder {
    /// The stage that the folder belongs to.
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// A further folder of the same stage.
    pub fn part(&self, part: &str) -> Self {
        self.stage.named(format!("{}-{part}", self.name))
    }

    /// A further folder beside this one, for what another stage makes for it: such as `4-surrogate-gradients`, with runs of
    /// the model, which depend on code as little as those of the design.
    pub fn beside(&self, stage: Stage, part: &str) -> Self {
        stage.named(format!("{}-{part}", self.name))
    }

    /// Name of the folder in the run directory.
    pub fn name(&self) -> &str {
        &self.name
    }
}

impl fmt::Display for Folder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_those_of_run_directories_that_there_are() {
        let names: Vec<String> = Stage::ALL.map(|stage| stage.folder().to_string()).into();
        assert_eq!(
            names,
            [
                "1-design",
                "2-simulate",
                "3-read",
                "3-numerical-error",
                "4-surrogate",
                "5-calibrate",
                "6-evidence",
                "6-validate",
                "6-quantities",
                "6-reliability",
                "6-assess",
                "7-gap",
                "7-show",
                "7-power",
                "7-coverage",
                "8-report"
            ]
        );
        assert_eq!(Stage::Simulate.part("finer").name(), "2-simulate-finer");
        assert_eq!(
            Stage::Simulate.inside(Stage::Calibrate, "refine-2").name(),
            "5-refine-2-simulate"
        );
        assert!(Stage::ALL.is_sorted_by_key(|stage| stage.number()));
        assert!(Stage::ALL.is_sorted());
    }
}
