//! The runs to which a surrogate is fitted, beside the numbers.

use lacuna::data::{Layouts, Parameter};
use serde::{Deserialize, Serialize};

/// Parameters and shapes of the responses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrainingAbout {
    /// The parameters with their design distributions.
    pub parameters: Vec<Parameter>,
    /// The shapes of the responses of one run.
    pub layouts: Layouts,
}
