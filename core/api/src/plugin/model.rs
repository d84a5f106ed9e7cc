//! Models: from parameters to a response.

use std::path::{Path, PathBuf};

use lacuna_base::data::{Layout, Scenario, Unit};
use lacuna_base::matrix::Matrix;
use thiserror::Error;

use super::{Amend, Component, Context, Fact};

/// A simulator.
pub trait Model: Component {
    /// Inputs and outputs of the model. A model that accepts whatever the study gives (a command, a server) returns the
    /// study's own inputs ([`Context::given`]) and layout.
    fn signature(&self, context: &Context<'_>) -> Signature;

    /// Inputs of the signature on which no response depends, whatever their values: a model may accept them so that a
    /// study can switch to it by its name alone. Parameters that set nothing else keep their priors.
    fn unused(&self, _context: &Context<'_>) -> Vec<String> {
        Vec::new()
    }

    /// True if the model evaluates the random fields of its conditions ([`Scenario::fields`]) itself. Their coefficients
    /// are then inputs; otherwise a field is one input for each of its places.
    fn takes_fields(&self) -> bool {
        false
    }

    /// Runs the simulator once.
    fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError>;

    /// Files of the user on which the response depends, such as a program or an input deck (for the hash of a stage's
    /// inputs); relative paths are resolved against `directory`. A folder stands for all files directly inside it.
    fn files(&self, _directory: &Path) -> Vec<PathBuf> {
        Vec::new()
    }

    /// Preferred number of evaluations per call; 1 if evaluations together cost the same as separately.
    fn batch(&self) -> usize {
        1
    }

    /// Runs the simulator for several calls, which differ only in inputs and folders: one result per call, in their
    /// order, each equal to that of [`Model::predict`].
    fn predict_batch(&self, calls: &[Call<'_>]) -> Vec<Result<Response, EvalError>> {
        calls.iter().map(|call| self.predict(call)).collect()
    }

    /// Derivatives of the response, if the model can compute them.
    fn gradient(&self) -> Option<&dyn Gradient> {
        None
    }

    /// Equations of the model, if a study can add terms to them.
    fn amend(&self) -> Option<&dyn Amend> {
        None
    }

    /// Writes a finished run in the simulator's own file format into `directory` and returns the file name; `None` if
    /// the model has no format of its own (the engine then writes NetCDF).
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
    /// Derivative of each value of the response by each input, `outputs x inputs`.
    fn jacobian(&self, call: &Call<'_>) -> Result<Matrix, EvalError>;

    /// The response with its derivatives from one run, if that costs less than computing them separately.
    fn with_response(&self, _call: &Call<'_>) -> Option<Result<(Response, Matrix), EvalError>> {
        None
    }
}

/// Inputs and outputs of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Signature {
    /// Inputs, in the order of [`Call::inputs`].
    pub inputs: Vec<Input>,
    /// Natural layout of the response; a study may request another (see [`Call::layout`]).
    pub layout: Layout,
    /// True if the model can return its response on another grid or a subset of labels of `layout`.
    pub resamples: bool,
}

/// One input of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// Name by which a study's parameter sets the input.
    pub name: String,
    /// Unit in which the model takes the input.
    pub unit: Unit,
    /// Value if no parameter of the study sets the input; `None` if one must.
    pub default: Option<f64>,
    /// Closed interval in which the model can be evaluated.
    pub range: (f64, f64),
    /// Description of the input.
    pub description: String,
}

/// Arguments of one evaluation of a model.
#[derive(Debug, Clone, Copy)]
pub struct Call<'a> {
    /// One value per input, in the order and the units of the signature.
    pub inputs: &'a [f64],
    /// Names of the inputs.
    pub names: &'a [String],
    /// Units of the inputs.
    pub units: &'a [Unit],
    /// Layout of the requested response.
    pub layout: &'a Layout,
    /// Conditions of the run.
    pub scenario: &'a Scenario,
    /// Folder of the study file; relative paths start here.
    pub study: &'a Path,
    /// Folder for files of the run that are kept; the model creates it if it needs one. `None` for an evaluation of
    /// which nothing is kept.
    pub directory: Option<&'a Path>,
}

impl<'a> Call<'a> {
    /// A call in the working directory of the process, for callers that do not use units.
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

/// Result of one evaluation of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// Values on the layout of the call.
    pub values: Vec<f64>,
    /// True if the run stayed inside the model's range of validity.
    pub valid: bool,
    /// Further facts about the run, for the report.
    pub facts: Vec<Fact>,
}

/// Error of a model evaluation.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum EvalError {
    /// No result for these inputs; others may succeed.
    #[error("{0}")]
    Rejected(String),
    /// No result for any inputs: the study must stop.
    #[error("{0}")]
    Fatal(String),
}
