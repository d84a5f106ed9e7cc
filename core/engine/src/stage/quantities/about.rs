//! Description of predicted quantities and of the variants in which they are predicted.

use serde::{Deserialize, Serialize};

use crate::study::quantity::Asked;

/// Description of predicted quantities.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct About {
    /// The quantities.
    pub quantities: Vec<Described>,
    /// The variants, in the order of the draws.
    pub variants: Vec<Variant>,
    /// Indices of the chains of the draws.
    pub chains: Vec<usize>,
    /// Indices of the steps in each of these chains, counted after the burn-in.
    pub steps: Vec<usize>,
    /// Ratio of independent to all draws.
    pub efficiency: f64,
}

/// Description of a predicted quantity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Described {
    /// Name with the labels of its curve and its scenario.
    pub name: String,
    /// Unit of all values.
    pub unit: String,
    /// Reference value, if the study gives one.
    pub reference: Option<f64>,
    /// Errors in the prediction, by origin.
    pub includes: Vec<String>,
    /// Errors that a new replicate has and the prediction does not contain, by origin.
    pub leaves_out: Vec<String>,
}

/// Variant of a prediction, by the sources of uncertainty in it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Variant {
    /// All sources that a quantity includes.
    Total,
    /// The posterior of the parameters alone.
    Parameters,
    /// All sources that a quantity includes but this one: `parameters`, or the origin of an error.
    Without(String),
}

/// Source of uncertainty that is no error: the posterior of the parameters.
pub(super) const PARAMETERS: &str = "parameters";

/// Variants of a prediction with errors of these origins.
pub(super) fn variants(origins: &[String]) -> Vec<Variant> {
    let mut all = vec![Variant::Total, Variant::Parameters];
    if !origins.is_empty() {
        all.push(Variant::Without(PARAMETERS.to_owned()));
        all.extend(origins.iter().cloned().map(Variant::Without));
    }
    all
}

/// Description of a quantity in a prediction with errors of these origins.
pub(super) fn described(asked: &Asked, origins: &[String]) -> Described {
    let own = |included: bool| -> Vec<String> {
        let chosen = |origin: &&String| asked.of_curve && asked.includes(origin) == included;
        origins.iter().filter(chosen).cloned().collect()
    };
    Described {
        name: asked.name.clone(),
        unit: asked.unit.to_string(),
        reference: asked.reference,
        includes: own(true),
        leaves_out: own(false),
    }
}
