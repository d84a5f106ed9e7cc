//! The unknowns of a model.

use serde::{Deserialize, Serialize};

use super::Unit;
use crate::math::distribution::Distribution;

/// An unknown of the model, as the study declares it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// The name, equal to that of an input of the model.
    pub name: String,
    /// The symbol used in figures, such as `x1`; the name when the study gives none.
    pub symbol: String,
    /// The unit of all its values.
    pub unit: Unit,
    /// Where the surrogate is trained.
    pub design: Distribution,
    /// Where the calibration looks.
    pub prior: Distribution,
    /// A value from the literature or from practice, to compare with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<f64>,
}

impl Parameter {
    /// A plain number of that name, whose runs are made where its prior is.
    pub fn plain(name: &str, prior: Distribution) -> Self {
        Self {
            name: name.to_owned(),
            symbol: name.to_owned(),
            unit: Unit::dimensionless(),
            design: prior.clone(),
            prior,
            reference: None,
        }
    }
}
