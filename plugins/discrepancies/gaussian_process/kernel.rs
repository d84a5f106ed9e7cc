//! Matérn correlations.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How smooth a bias is (Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), 4.2).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kernel {
    /// Matérn with index 3/2: it has one derivative.
    #[serde(rename = "matern_3_2")]
    ThreeHalves,
    /// Matérn with index 5/2: it has two derivatives.
    #[default]
    #[serde(rename = "matern_5_2")]
    FiveHalves,
}

impl Kernel {
    /// The correlation at a distance, and its derivative by the length.
    pub(super) fn at(self, distance: f64, length: f64) -> (f64, f64) {
        match self {
            Self::ThreeHalves => {
                let x = 3.0_f64.sqrt() * distance / length;
                let e = (-x).exp();
                ((1.0 + x) * e, x * x * e / length)
            }
            Self::FiveHalves => {
                let x = 5.0_f64.sqrt() * distance / length;
                let e = (-x).exp();
                ((1.0 + x + x * x / 3.0) * e, x * x * (1.0 + x) * e / (3.0 * length))
            }
        }
    }
}
