//! The arguments of a quantity.

use lacuna::data::Unit;
use lacuna::plugin::quantity::{Arguments, Curve, Misfit, Number};
use serde::{Deserialize, Serialize};

use super::Complaint;

/// The arguments of a quantity, with values of their own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OwnedArguments {
    /// The values of a curve.
    Curve(OwnedCurve),
    /// Named numbers.
    Numbers(Vec<OwnedNumber>),
}

/// A curve of the response.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OwnedCurve {
    name: String,
    unit: Unit,
    axis: String,
    grid: Vec<f64>,
    grid_unit: Unit,
}

/// A number on which a quantity may depend.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OwnedNumber {
    name: String,
    unit: Option<Unit>,
}

impl From<&Arguments<'_>> for OwnedArguments {
    fn from(arguments: &Arguments<'_>) -> Self {
        match arguments {
            Arguments::Curve(curve) => Self::Curve(OwnedCurve {
                name: curve.name.to_owned(),
                unit: curve.unit.clone(),
                axis: curve.axis.to_owned(),
                grid: curve.grid.to_vec(),
                grid_unit: curve.grid_unit.clone(),
            }),
            Arguments::Numbers(numbers) => {
                let owned = |number: &Number<'_>| OwnedNumber {
                    name: number.name.to_owned(),
                    unit: number.unit.cloned(),
                };
                Self::Numbers(numbers.iter().map(owned).collect())
            }
        }
    }
}

impl OwnedArguments {
    /// Lends the arguments as the trait takes them.
    pub fn with<R>(&self, take: impl FnOnce(&Arguments<'_>) -> R) -> R {
        match self {
            Self::Curve(curve) => take(&Arguments::Curve(Curve {
                name: &curve.name,
                unit: &curve.unit,
                axis: &curve.axis,
                grid: &curve.grid,
                grid_unit: &curve.grid_unit,
            })),
            Self::Numbers(owned) => {
                let numbers: Vec<Number<'_>> = owned.iter().map(OwnedNumber::lent).collect();
                take(&Arguments::Numbers(&numbers))
            }
        }
    }
}

impl OwnedNumber {
    fn lent(&self) -> Number<'_> {
        Number { name: &self.name, unit: self.unit.as_ref() }
    }
}

impl From<Misfit> for Complaint {
    fn from(misfit: Misfit) -> Self {
        let Misfit { key, part, message, expected, found, help } = misfit;
        Self { at: key, part, message, expected, found, help: help.into_iter().collect() }
    }
}

impl From<Complaint> for Misfit {
    fn from(complaint: Complaint) -> Self {
        let Complaint { at, part, message, expected, found, help } = complaint;
        let help = (!help.is_empty()).then(|| help.join("; "));
        Self { key: at, part, message, expected, found, help }
    }
}
