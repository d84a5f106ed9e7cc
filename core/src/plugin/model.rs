//! Models: from parameters to a response.

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::{Amend, Component, Context, Fact};
use crate::data::{Layout, Scenario, Unit};
use crate::linalg::Matrix;

/// A simulator.
pub trait Model: Component {
    /// What goes in and what comes out. A model that takes whatever the study gives (a command, a server)
    /// answers with the study's own inputs ([`Context::given`]) and layout.
    fn signature(&self, context: &Context<'_>) -> Signature;

    /// The inputs of the signature on which no response depends, whatever their values: a model may take them so that a
    /// study can change to it by its name alone. Parameters that set nothing else keep their priors.
    fn unused(&self, _context: &Context<'_>) -> Vec<String> {
        Vec::new()
    }

    /// Runs the simulator once.
    fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError>;

    /// The user's files that the answers depend on, such as a program or an input deck (for the hash of a
    /// stage's inputs), relative paths resolved against `directory`. Folders stand for all files directly in
    /// them.
    fn files(&self, _directory: &Path) -> Vec<PathBuf> {
        Vec::new()
    }

    /// How many evaluations are best asked for at once; 1 where each costs the same alone.
    fn batch(&self) -> usize {
        1
    }

    /// Runs the simulator for several calls, which differ in their inputs and folders only: one answer a
    /// call, in their order, each the same as [`Model::predict`] gives.
    fn predict_batch(&self, calls: &[Call<'_>]) -> Vec<Result<Response, EvalError>> {
        calls.iter().map(|call| self.predict(call)).collect()
    }

    /// Derivatives of the response, where the model knows them.
    fn gradient(&self) -> Option<&dyn Gradient> {
        None
    }

    /// Its equations, where a study can add terms to them.
    fn amend(&self) -> Option<&dyn Amend> {
        None
    }

    /// Writes a finished run in the simulator's own file format into `directory` and returns the
    /// file's name; `None` when the model has no format of its own (the engine then writes NetCDF).
    fn write(
        &self,
        _run: &str,
        _call: &Call<'_>,
        _response: &Response,
        _directory: &Path,
    ) -> Result<Option<String>, EvalError> {
        Ok(None)
    }
}

/// Derivatives of a model's response.
pub trait Gradient: Send + Sync {
    /// The derivatives of each value of the response (rows) by each input (columns).
    fn jacobian(&self, call: &Call<'_>) -> Result<Matrix, EvalError>;

    /// The response with its derivatives from one run, where that costs less than asking for each.
    fn with_response(&self, _call: &Call<'_>) -> Option<Result<(Response, Matrix), EvalError>> {
        None
    }
}

/// What goes into a model and what comes out of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Signature {
    /// The inputs, in the order in which [`Call::inputs`] gives them.
    pub inputs: Vec<Input>,
    /// The response at its natural layout; a study may ask for another (see [`Call::layout`]).
    pub layout: Layout,
    /// Whether the model can answer on another grid or subset of labels than `layout`.
    pub resamples: bool,
}

/// One input of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// The name by which a study's parameter sets it.
    pub name: String,
    /// The unit in which the model takes it.
    pub unit: Unit,
    /// The value when no parameter of the study sets it; `None` when a parameter must.
    pub default: Option<f64>,
    /// The closed range in which the model answers.
    pub range: (f64, f64),
    /// What it is, in words.
    pub description: String,
}

/// One evaluation that is asked of a model.
#[derive(Debug, Clone, Copy)]
pub struct Call<'a> {
    /// One value an input, in the order and the units of the signature.
    pub inputs: &'a [f64],
    /// The name of each input.
    pub names: &'a [String],
    /// The unit of each input.
    pub units: &'a [Unit],
    /// The shape of the response that is wanted.
    pub layout: &'a Layout,
    /// The conditions of the run.
    pub scenario: &'a Scenario,
    /// The folder of the study file; relative paths start here.
    pub study: &'a Path,
    /// A folder of the run's own for files that are kept; the model makes it when it needs one. `None` for an
    /// evaluation of which nothing is kept.
    pub directory: Option<&'a Path>,
}

impl<'a> Call<'a> {
    /// A call in the folder of the process, by a caller that knows no units.
    pub fn new(
        inputs: &'a [f64],
        names: &'a [String],
        layout: &'a Layout,
        scenario: &'a Scenario,
    ) -> Self {
        let (units, study, directory) = (&[][..], Path::new("."), None);
        Self { inputs, names, units, layout, scenario, study, directory }
    }
}

/// What a model answers.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// The values on the layout of the call.
    pub values: Vec<f64>,
    /// Whether the run stayed inside the model's range of validity.
    pub valid: bool,
    /// Further figures of the run, for people.
    pub facts: Vec<Fact>,
}

/// No answer from a model.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum EvalError {
    /// No answer for these inputs; others may do.
    #[error("{0}")]
    Rejected(String),
    /// No answer for any inputs: the study must stop.
    #[error("{0}")]
    Fatal(String),
}
