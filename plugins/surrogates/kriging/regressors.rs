//! Regressors from which trends are built.

use lacuna_linalg::Matrix;
use serde::{Deserialize, Serialize};

use super::standard::Standard;
use crate::surrogates::polynomial_chaos::{Basis, Coordinate, Terms};

/// Regressors of the trend.
#[derive(Debug, Clone, PartialEq)]
pub enum Regressors {
    /// The constant 1.
    Constant,
    /// The constant 1 and the standard variables.
    Linear(Vec<Standard>),
    /// Products of orthonormal polynomials.
    Polynomials(Basis),
}

/// Regressors as saved next to the standard variables.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Written {
    Constant,
    Linear,
    Polynomials { coordinates: Vec<Coordinate>, exponents: Vec<u16> },
}

impl Regressors {
    /// Returns the number of regressors.
    pub fn count(&self) -> usize {
        match self {
            Self::Constant => 1,
            Self::Linear(standards) => standards.len() + 1,
            Self::Polynomials(basis) => basis.terms().len(),
        }
    }

    /// Returns their values at points in physical units, one per row (`points x regressors`).
    pub fn values(&self, points: &Matrix) -> Matrix {
        match self {
            Self::Constant => Matrix::from_vec(points.rows(), 1, vec![1.0; points.rows()]),
            Self::Linear(standards) => {
                Matrix::from_fn(points.rows(), self.count(), |i, j| match j.checked_sub(1) {
                    None => 1.0,
                    Some(k) => standards[k].at(points[(i, k)]),
                })
            }
            Self::Polynomials(basis) => basis.values(points),
        }
    }

    /// Returns their derivatives (rows) with respect to the parameters (columns) at a point in physical units.
    pub fn gradient(&self, point: &[f64]) -> Matrix {
        match self {
            Self::Constant => Matrix::zeros(1, point.len()),
            Self::Linear(standards) => Matrix::from_fn(self.count(), point.len(), |j, k| {
                if j == k + 1 { standards[k].slope(point[k]) } else { 0.0 }
            }),
            Self::Polynomials(basis) => basis.gradient(point),
        }
    }

    /// Returns the form to save.
    pub fn written(&self) -> Written {
        match self {
            Self::Constant => Written::Constant,
            Self::Linear(_) => Written::Linear,
            Self::Polynomials(basis) => Written::Polynomials {
                coordinates: basis.coordinates().to_vec(),
                exponents: basis.terms().exponents().to_vec(),
            },
        }
    }
}

impl Written {
    /// Restores the regressors; `None` if the parts are inconsistent.
    pub fn read(self, standards: &[Standard]) -> Option<Regressors> {
        Some(match self {
            Self::Constant => Regressors::Constant,
            Self::Linear => Regressors::Linear(standards.to_vec()),
            Self::Polynomials { coordinates, exponents } => {
                let d = standards.len();
                if coordinates.len() != d || exponents.len() % d != 0 {
                    return None;
                }
                Regressors::Polynomials(Basis::new(
                    coordinates,
                    Terms::from_exponents(d, exponents),
                ))
            }
        })
    }
}
