//! Random fields in their Karhunen-Loève expansion.

use serde::{Deserialize, Serialize};

use super::Unit;
use crate::matrix::Matrix;

/// A random field along one coordinate in a truncated Karhunen-Loève expansion. With independent standard normal
/// coefficients `ξ_k` the field is `g(x) = level(x) + Σ ξ_k mode_k(x)`, or `exp g(x)` if it is log-normal. Between two
/// places level and modes are cubic splines; beyond the first and the last they are constant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Field {
    /// Name, such as `conductivity`.
    pub name: String,
    /// Unit of the field's values.
    pub unit: Unit,
    /// Name of the coordinate.
    pub axis: String,
    /// Places, strictly increasing.
    pub at: Vec<f64>,
    /// Unit of the places.
    pub at_unit: Unit,
    /// Mean of `g` at each place: that of the field, or the logarithm of its median in `unit`.
    pub level: Vec<f64>,
    /// Eigenfunctions times the standard deviations of their coefficients, `terms x places`.
    pub modes: Matrix,
    /// Standard deviation of `g` with all terms.
    pub sd: f64,
    /// True if the logarithm of the field is normal.
    pub log_normal: bool,
    /// Share of the variance of `g`, integrated over the places, that the terms keep.
    pub kept: f64,
}

impl Field {
    /// Number of terms.
    pub fn terms(&self) -> usize {
        self.modes.rows()
    }

    /// Name of the vector of the coefficients: `conductivity.term`.
    pub fn vector(&self) -> String {
        format!("{}.term", self.name)
    }

    /// Names of the coefficients: `conductivity.term[1]` and so on.
    pub fn coefficients(&self) -> Vec<String> {
        (1..=self.terms()).map(|k| format!("{}.term[{k}]", self.name)).collect()
    }

    /// Names of the values at the places as inputs of a model: `conductivity[1]` and so on.
    pub fn inputs(&self) -> Vec<String> {
        (1..=self.at.len()).map(|i| format!("{}[{i}]", self.name)).collect()
    }

    /// Values of the field at its places for these coefficients.
    pub fn values(&self, coefficients: &[f64]) -> Vec<f64> {
        let value = |(i, level): (usize, &f64)| {
            let terms = coefficients.iter().enumerate().map(|(k, c)| c * self.modes[(k, i)]);
            let normal = level + terms.sum::<f64>();
            if self.log_normal { normal.exp() } else { normal }
        };
        self.level.iter().enumerate().map(value).collect()
    }

    /// Standard deviation of the neglected terms of `g` at each place.
    pub fn neglected(&self) -> Vec<f64> {
        let square = |i: usize| (0..self.terms()).map(|k| self.modes[(k, i)].powi(2)).sum::<f64>();
        // With all terms nothing but rounding errors is left.
        let rest = |i: usize| (1.0 - square(i) / (self.sd * self.sd)).max(0.0);
        let rest = |i: usize| if rest(i) < 1e-12 { 0.0 } else { self.sd * rest(i).sqrt() };
        (0..self.at.len()).map(rest).collect()
    }
}
