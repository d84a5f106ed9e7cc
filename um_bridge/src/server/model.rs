//! Models that a server offers.

use crate::protocol::{Config, Fault, Support, UNSUPPORTED_FEATURE};

/// A function from vectors to vectors.
///
/// The server checks the sizes of inputs and outputs; a derivative is requested only if [`Model::support`] includes it.
pub trait Model: Sync {
    /// Name by which clients request the model.
    fn name(&self) -> &str;

    /// Operations that the model supports.
    fn support(&self) -> Support;

    /// Length of each input vector.
    fn input_sizes(&self, config: &Config) -> Result<Vec<usize>, Fault>;

    /// Length of each output vector.
    fn output_sizes(&self, config: &Config) -> Result<Vec<usize>, Fault>;

    /// Evaluates the output vectors.
    fn evaluate(&self, input: &[Vec<f64>], config: &Config) -> Result<Vec<Vec<f64>>, Fault>;

    /// Gradient of `sens · output` by the input `in_wrt`.
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

    /// Derivative of the output `out_wrt` along the direction `vec` of the input `in_wrt`.
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

    /// Second derivative of `sens · output` by the first input and along the direction `vec` of the second input.
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

/// Fault of a model that does not support an operation.
pub(super) fn unsupported(what: &str, name: &str) -> Fault {
    Fault::new(UNSUPPORTED_FEATURE, format!("the model `{name}` does not support {what}"))
}
