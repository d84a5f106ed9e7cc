//! Messages of the protocol, with the protocol's names.

use serde::{Deserialize, Serialize};

/// Version of the protocol that this crate implements.
pub const VERSION: f64 = 1.0;

/// Settings of a model; their meaning is defined by the model.
pub type Config = serde_json::Map<String, serde_json::Value>;

/// Response to `GET /Info`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Info {
    /// Version of the protocol that the server implements.
    pub protocol_version: f64,
    /// Names of the models.
    pub models: Vec<String>,
}

/// Request to `POST /ModelInfo`, `/InputSizes` and `/OutputSizes`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct About {
    /// Name of the model.
    pub name: String,
    /// Settings of the model.
    #[serde(default)]
    pub config: Config,
}

/// Response to `POST /ModelInfo`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelInfo {
    /// Operations that the model supports.
    pub support: Support,
}

/// Operations that a model supports.
#[expect(clippy::struct_excessive_bools, reason = "the protocol's own four")]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "PascalCase", default)]
pub struct Support {
    /// Evaluation of the outputs.
    pub evaluate: bool,
    /// Gradient of a weighted sum of an output by an input.
    pub gradient: bool,
    /// Derivative of an output along a direction of an input.
    pub apply_jacobian: bool,
    /// Derivative of a gradient along a direction of an input.
    pub apply_hessian: bool,
}

/// Response to `POST /InputSizes`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct InputSizes {
    /// Length of each input vector.
    pub input_sizes: Vec<usize>,
}

/// Response to `POST /OutputSizes`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct OutputSizes {
    /// Length of each output vector.
    pub output_sizes: Vec<usize>,
}

/// Request to `POST /Evaluate`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluate {
    /// Name of the model.
    pub name: String,
    /// Input vectors.
    pub input: Vec<Vec<f64>>,
    /// Settings of the model.
    #[serde(default)]
    pub config: Config,
}

/// Request to `POST /Gradient`: the gradient of `sens · output` by an input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Gradient {
    /// Name of the model.
    pub name: String,
    /// Index of the output vector.
    pub out_wrt: usize,
    /// Index of the input vector.
    pub in_wrt: usize,
    /// Input vectors.
    pub input: Vec<Vec<f64>>,
    /// Weight of each value of the output.
    pub sens: Vec<f64>,
    /// Settings of the model.
    #[serde(default)]
    pub config: Config,
}

/// Request to `POST /ApplyJacobian`: the derivative of an output along a direction of an input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct ApplyJacobian {
    /// Name of the model.
    pub name: String,
    /// Index of the output vector.
    pub out_wrt: usize,
    /// Index of the input vector.
    pub in_wrt: usize,
    /// Input vectors.
    pub input: Vec<Vec<f64>>,
    /// Direction in the input vector.
    pub vec: Vec<f64>,
    /// Settings of the model.
    #[serde(default)]
    pub config: Config,
}

/// Request to `POST /ApplyHessian`: the second derivative of `sens · output` by the first input and along a direction
/// of the second input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct ApplyHessian {
    /// Name of the model.
    pub name: String,
    /// Index of the output vector.
    pub out_wrt: usize,
    /// Index of the input vector by which the result is a derivative.
    pub in_wrt1: usize,
    /// Index of the input vector to which the direction belongs.
    pub in_wrt2: usize,
    /// Input vectors.
    pub input: Vec<Vec<f64>>,
    /// Weight of each value of the output.
    pub sens: Vec<f64>,
    /// Direction in the second input vector.
    pub vec: Vec<f64>,
    /// Settings of the model.
    #[serde(default)]
    pub config: Config,
}

/// Response to an evaluation (one vector per output) or a derivative (one vector).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Output<T> {
    /// Values.
    pub output: T,
}

/// Response that reports an error.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failed {
    /// Description of the error.
    pub error: Fault,
}

/// Description of an error by a server.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[error("{kind}: {message}")]
pub struct Fault {
    /// Type of the error, such as `InvalidInput`.
    #[serde(rename = "type")]
    pub kind: String,
    /// Message of the error.
    pub message: String,
}

/// The server has no model of this name.
pub const MODEL_NOT_FOUND: &str = "ModelNotFound";
/// The model does not support this operation.
pub const UNSUPPORTED_FEATURE: &str = "UnsupportedFeature";
/// The request is malformed, of the wrong size, or cannot be evaluated.
pub const INVALID_INPUT: &str = "InvalidInput";
/// The model's output is of the wrong size or not finite.
pub const INVALID_OUTPUT: &str = "InvalidOutput";
/// The model failed.
pub const INTERNAL_ERROR: &str = "InternalError";

impl Fault {
    /// A fault of this type.
    pub fn new(kind: &str, message: impl Into<String>) -> Self {
        Self { kind: kind.to_owned(), message: message.into() }
    }
}
