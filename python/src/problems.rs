//! Studies with their problems.

use std::path::PathBuf;

use lacuna::run::Stop;
use lacuna::text::emit;
use lacuna_engine::stage::contents;
use lacuna_engine::study::resolve::{self, Use};
use lacuna_engine::study::{Checked, Study};
use pyo3::create_exception;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

create_exception!(
    lacuna,
    StudyError,
    PyValueError,
    "The study has problems; the message lists all of them, with their places."
);
create_exception!(lacuna, RunError, PyRuntimeError, "A run stopped.");

/// A study as Python gives it: the path of a file, or a dictionary as JSON with the path at which it is thought to stand.
#[derive(FromPyObject)]
pub struct Source {
    #[pyo3(item)]
    path: PathBuf,
    #[pyo3(item)]
    json: Option<String>,
    #[pyo3(item)]
    set: Vec<String>,
}

impl Source {
    /// The study, checked for this purpose.
    pub fn load(&self, purpose: Use) -> PyResult<Study> {
        let checked = match &self.json {
            None => resolve::load_for(&self.path, &self.set, purpose),
            Some(json) => resolve::load_text(&self.path, &toml(json)?, &self.set),
        };
        sound(checked)
    }
}

/// A dictionary as the text of a study file.
fn toml(json: &str) -> PyResult<String> {
    let value: serde_json::Value =
        serde_json::from_str(json).map_err(|error| StudyError::new_err(error.to_string()))?;
    emit::to_toml(&value).map_err(|error| StudyError::new_err(error.to_string()))
}

fn sound(checked: Checked) -> PyResult<Study> {
    let complaints = checked.complaints();
    checked.study.ok_or_else(|| StudyError::new_err(complaints.trim_end().to_owned()))
}

/// The exception for a run that stopped.
pub fn stopped(stop: &Stop) -> PyErr {
    RunError::new_err(stop.to_string())
}

/// Checks a study and the contents of its files.
///
/// # Errors
/// `StudyError` with all problems.
#[pyfunction]
pub fn check(py: Python<'_>, source: Source) -> PyResult<()> {
    py.detach(|| {
        let study = source.load(Use::Check)?;
        let wrong = contents::check(&study).err().unwrap_or_default();
        if wrong.is_empty() {
            return Ok(());
        }
        let texts: Vec<String> = wrong.iter().map(ToString::to_string).collect();
        Err(StudyError::new_err(texts.join("\n\n")))
    })
}
