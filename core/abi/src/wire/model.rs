//! Inputs and outputs of a model, beside the numbers.

use std::path::PathBuf;

use lacuna::data::{Layout, Scenario, Unit};
use lacuna::plugin::model::{Input, Signature};
use lacuna::plugin::{Context, Fact};
use serde::{Deserialize, Serialize};

/// Signature of a model; omitted parts are those of the study.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct SignatureAbout {
    inputs: Option<Vec<InputAbout>>,
    layout: Option<Layout>,
    resamples: bool,
}

/// An input; a bound that is not there is infinite.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct InputAbout {
    name: String,
    unit: Unit,
    #[serde(default)]
    default: Option<f64>,
    #[serde(default)]
    low: Option<f64>,
    #[serde(default)]
    high: Option<f64>,
    #[serde(default)]
    description: String,
}

impl From<Signature> for SignatureAbout {
    fn from(signature: Signature) -> Self {
        let bound = |x: f64| x.is_finite().then_some(x);
        let input = |input: Input| InputAbout {
            name: input.name,
            unit: input.unit,
            default: input.default,
            low: bound(input.range.0),
            high: bound(input.range.1),
            description: input.description,
        };
        Self {
            inputs: Some(signature.inputs.into_iter().map(input).collect()),
            layout: Some(signature.layout),
            resamples: signature.resamples,
        }
    }
}

impl SignatureAbout {
    /// The signature in a study.
    pub fn in_study(self, context: &Context<'_>) -> Signature {
        let input = |input: InputAbout| Input {
            name: input.name,
            unit: input.unit,
            default: input.default,
            range: (input.low.unwrap_or(f64::NEG_INFINITY), input.high.unwrap_or(f64::INFINITY)),
            description: input.description,
        };
        let given = || as_given(context);
        Signature {
            inputs: self.inputs.map_or_else(given, |all| all.into_iter().map(input).collect()),
            layout: self.layout.unwrap_or_else(|| context.layout.clone()),
            resamples: self.resamples,
        }
    }
}

/// The inputs that a study gives.
fn as_given(context: &Context<'_>) -> Vec<Input> {
    let input = |given: &lacuna::plugin::Given| Input {
        name: given.name.clone(),
        unit: given.unit.clone().unwrap_or_else(Unit::dimensionless),
        default: None,
        range: (f64::NEG_INFINITY, f64::INFINITY),
        description: "as the study gives it".to_owned(),
    };
    context.given.iter().map(input).collect()
}

/// The properties that all calls of a batch have in common.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CallsAbout {
    /// The name of each input.
    pub names: Vec<String>,
    /// The unit of each, where the caller knows units.
    pub units: Vec<Unit>,
    /// The shape of the response that is wanted.
    pub layout: Layout,
    /// The conditions of the runs.
    pub scenario: Scenario,
    /// The folder of the study file.
    pub study: PathBuf,
}

/// The message and the facts of one evaluation.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct CallSaid {
    /// Why it has no answer.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub message: String,
    /// Further figures.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub facts: Vec<Fact>,
}

/// A response without its values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResponseAbout {
    /// True where the run stayed inside the model's range of validity.
    pub valid: bool,
    /// Further figures.
    pub facts: Vec<Fact>,
}
