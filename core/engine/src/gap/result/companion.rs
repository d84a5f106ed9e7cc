//! A companion with its constants and its errors, as plain data.

use std::path::Path;

use lacuna::run::{Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::Artifact;
use lacuna_run::arrays::{self, Array};
use serde::{Deserialize, Serialize};

use crate::study::gap::Companion;

/// A companion whose constants are known, with its errors on the simulation runs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct IdentifiedCompanion {
    /// The values of its constants, in their units.
    pub constants: Vec<f64>,
    /// The runs from which the constants were identified; empty if the study states them.
    pub runs: Vec<String>,
    /// The number of other runs on which the companion was checked.
    pub checked: usize,
    /// The root mean square error on these, divided by the root mean square of the response about its mean.
    pub error: f64,
    /// The root mean square error of changes between runs, divided by the root mean square change: the relative error of
    /// the size of a candidate.
    pub of_changes: f64,
    /// True if `error` is at most the study's `gate`.
    pub admitted: bool,
    /// The errors of changes between runs, `changes x outputs`, in the response's unit: the forms of what its candidates
    /// leave.
    #[serde(skip)]
    pub errors: Matrix,
}

const FILE: &str = "companion.json";
const ERRORS: &str = "errors.nc";

impl Artifact for IdentifiedCompanion {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_json(&folder.join(FILE), self)?;
        let errors = Array::matrix("errors", "change", "output", &self.errors);
        arrays::write(&folder.join(ERRORS), &[], &[errors])?;
        Ok([FILE, ERRORS].map(str::to_owned).to_vec())
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        let found: Self = files::read_json(&folder.join(FILE))?;
        let errors = arrays::read(&folder.join(ERRORS), "errors")?.into_matrix();
        Ok(Self { errors, ..found })
    }
}

impl IdentifiedCompanion {
    /// The companion in a sentence, with the figure that decides whether it is used.
    pub fn words(&self, companion: &Companion) -> String {
        let gate = companion.keys.gate.get();
        let error = format!(
            "its error on {} runs is {:.3} of the response's root mean square",
            self.checked, self.error
        );
        if self.admitted {
            format!("the companion is used: {error}, at most {gate} is allowed")
        } else {
            format!(
                "the companion is not used: {error}, and at most {gate} is allowed; give it more of the simulator's \
                 physics, or more constants in `[[gap.companion.parameter]]`"
            )
        }
    }
}
