//! What a server serves.

use crate::protocol::{Config, Fault, Support, UNSUPPORTED_FEATURE};

/// A function from some vectors to some vectors.
///
/// The server checks the sizes of what comes in and of what goes out; a derivative is asked for only where
/// [`Model::support`] says so.
pub trait Model: Sync {
    /// The name by which clients ask for it.
    fn name(&self) -> &str;

    /// What it can be asked for.
    fn support(&self) -> Support;

    /// The length of each input vector.
    fn input_sizes(&self, config: &Config) -> Result<Vec<usize>, Fault>;

    /// The length of each output vector.
    fn output_sizes(&self, config: &Config) -> Result<Vec<usize>, Fault>;

    /// The output vectors.
    fn evaluate(&self, input: &[Vec<f64>], config: &Config) -> Result<Vec<Vec<f64>>, Fault>;

    /// The derivatives of `sens · output` by the input `in_wrt`.
    fn gradient(
        &self,
        _out_wrt: usize,
        _in_wrt: usize,
        _input: &[Vec<f64>],
        _sens: &[f64],
        _config: &Config,
    ) -> Result<Vec<f64>, Fault> {
        Err(unsupported("Gradient", self.name()))
    }

    /// The derivative of the output `out_wrt` along the direction `vec` of the input `in_wrt`.
    fn apply_jacobian(
        &self,
        _out_wrt: usize,
        _in_wrt: usize,
        _input: &[Vec<f64>],
        _vec: &[f64],
        _config: &Config,
    ) -> Result<Vec<f64>, Fault> {
        Err(unsupported("ApplyJacobian", self.name()))
    }

    /// The derivatives of `sens · output` by the first input and, along the direction `vec`, the second.
    fn apply_hessian(
        &self,
        _out_wrt: usize,
        _in_wrt: [usize; 2],
        _input: &[Vec<f64>],
        _sens: &[f64],
        _vec: &[f64],
        _config: &Config,
    ) -> Result<Vec<f64>, Fault> {
        Err(unsupported("ApplyHessian", self.name()))
    }
}

/// The fault of a model that cannot be asked for this.
pub(super) fn unsupported(what: &str, name: &str) -> Fault {
    Fault::new(UNSUPPORTED_FEATURE, format!("the model `{name}` does not support {what}"))
}
