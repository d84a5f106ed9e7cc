//! What goes over the wire, by the names of the protocol.

use serde::{Deserialize, Serialize};

/// The version of the protocol that this crate speaks.
pub const VERSION: f64 = 1.0;

/// Settings of a model, as it defines them.
pub type Config = serde_json::Map<String, serde_json::Value>;

/// The answer to `GET /Info`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Info {
    /// The version of the protocol that the server speaks.
    pub protocol_version: f64,
    /// The names of its models.
    pub models: Vec<String>,
}

/// The question of `POST /ModelInfo`, `/InputSizes` and `/OutputSizes`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct About {
    /// The model's name.
    pub name: String,
    /// Its settings.
    #[serde(default)]
    pub config: Config,
}

/// The answer to `POST /ModelInfo`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelInfo {
    /// What the model can be asked for.
    pub support: Support,
}

/// What a model can be asked for.
#[expect(clippy::struct_excessive_bools, reason = "the protocol's own four")]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "PascalCase", default)]
pub struct Support {
    /// Its outputs.
    pub evaluate: bool,
    /// The derivative of a weighted sum of an output by an input.
    pub gradient: bool,
    /// The derivative of an output along a direction of an input.
    pub apply_jacobian: bool,
    /// The derivative of a gradient along a direction of an input.
    pub apply_hessian: bool,
}

/// The answer to `POST /InputSizes`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct InputSizes {
    /// The length of each input vector.
    pub input_sizes: Vec<usize>,
}

/// The answer to `POST /OutputSizes`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct OutputSizes {
    /// The length of each output vector.
    pub output_sizes: Vec<usize>,
}

/// The question of `POST /Evaluate`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluate {
    /// The model's name.
    pub name: String,
    /// The input vectors.
    pub input: Vec<Vec<f64>>,
    /// The model's settings.
    #[serde(default)]
    pub config: Config,
}

/// The question of `POST /Gradient`: the derivatives of `sens · output` by an input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Gradient {
    /// The model's name.
    pub name: String,
    /// Which output vector.
    pub out_wrt: usize,
    /// Which input vector.
    pub in_wrt: usize,
    /// The input vectors.
    pub input: Vec<Vec<f64>>,
    /// The weight of each value of the output.
    pub sens: Vec<f64>,
    /// The model's settings.
    #[serde(default)]
    pub config: Config,
}

/// The question of `POST /ApplyJacobian`: the derivative of an output along a direction of an input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct ApplyJacobian {
    /// The model's name.
    pub name: String,
    /// Which output vector.
    pub out_wrt: usize,
    /// Which input vector.
    pub in_wrt: usize,
    /// The input vectors.
    pub input: Vec<Vec<f64>>,
    /// The direction.
    pub vec: Vec<f64>,
    /// The model's settings.
    #[serde(default)]
    pub config: Config,
}

/// The question of `POST /ApplyHessian`: the second derivatives of `sens · output` by the first input and, along a
/// direction, the second.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct ApplyHessian {
    /// The model's name.
    pub name: String,
    /// Which output vector.
    pub out_wrt: usize,
    /// Which input vector the answer is by.
    pub in_wrt1: usize,
    /// Which input vector the direction is of.
    pub in_wrt2: usize,
    /// The input vectors.
    pub input: Vec<Vec<f64>>,
    /// The weight of each value of the output.
    pub sens: Vec<f64>,
    /// The direction.
    pub vec: Vec<f64>,
    /// The model's settings.
    #[serde(default)]
    pub config: Config,
}

/// The answer to an evaluation (one vector an output) or a derivative (one vector).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Output<T> {
    /// The values.
    pub output: T,
}

/// An answer that is an error.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failed {
    /// What is wrong.
    pub error: Fault,
}

/// What is wrong, as a server says it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[error("{kind}: {message}")]
pub struct Fault {
    /// What sort of error, such as `InvalidInput`.
    #[serde(rename = "type")]
    pub kind: String,
    /// In words.
    pub message: String,
}

/// The server has no model of this name.
pub const MODEL_NOT_FOUND: &str = "ModelNotFound";
/// The model cannot be asked for this.
pub const UNSUPPORTED_FEATURE: &str = "UnsupportedFeature";
/// The question is malformed, of the wrong size, or has no answer.
pub const INVALID_INPUT: &str = "InvalidInput";
/// The model's answer is of the wrong size or not finite.
pub const INVALID_OUTPUT: &str = "InvalidOutput";
/// The model broke.
pub const INTERNAL_ERROR: &str = "InternalError";

impl Fault {
    /// A fault of this kind.
    pub fn new(kind: &str, message: impl Into<String>) -> Self {
        Self { kind: kind.to_owned(), message: message.into() }
    }
}
