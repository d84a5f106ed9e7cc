//! Functions whose linear combinations are the outputs of an expansion.

use std::borrow::Cow;

use lacuna_linalg::{Matrix, multiply, multiply_transposed, transposed_multiply};

use super::terms::Basis;

/// The basis functions themselves; or the constant and the few components that were fitted in place of many outputs,
/// each of them a combination of basis functions.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Functions {
    pub basis: Basis,
    /// Coefficients of each function (`terms x functions`); `None` for the basis functions themselves.
    pub combined: Option<Matrix>,
}

impl Functions {
    /// Returns the basis functions themselves.
    pub fn of(basis: Basis) -> Self {
        Self { basis, combined: None }
    }

    /// Returns the constant, which is the first basis function, and combinations with these coefficients
    /// (`terms x components`).
    pub fn with_constant(basis: Basis, coefficients: &Matrix) -> Self {
        let entry = |t: usize, k: usize| match k.checked_sub(1) {
            Some(component) => coefficients[(t, component)],
            None => f64::from(u8::from(t == 0)),
        };
        let size = coefficients.columns() + 1;
        let combined = Some(Matrix::from_fn(coefficients.rows(), size, entry));
        Self { basis, combined }
    }

    /// Returns the number of functions.
    pub fn len(&self) -> usize {
        self.combined.as_ref().map_or(self.basis.terms().len(), Matrix::columns)
    }

    /// Returns the functions at points in physical units, one per row (`points x functions`).
    pub fn values(&self, points: &Matrix) -> Matrix {
        let values = self.basis.values(points);
        match &self.combined {
            Some(combined) => multiply(&values, combined),
            None => values,
        }
    }

    /// Returns the derivative of each function by each parameter (`functions x parameters`).
    pub fn gradient(&self, point: &[f64]) -> Matrix {
        let gradient = self.basis.gradient(point);
        match &self.combined {
            Some(combined) => transposed_multiply(combined, &gradient),
            None => gradient,
        }
    }

    /// Converts coefficients of the functions (`functions x outputs`) to those of the basis functions
    /// (`terms x outputs`).
    pub fn of_terms<'a>(&self, coefficients: &'a Matrix) -> Cow<'a, Matrix> {
        match &self.combined {
            Some(combined) => Cow::Owned(multiply(combined, coefficients)),
            None => Cow::Borrowed(coefficients),
        }
    }

    /// Converts a factor on the functions and 1 (`any x (functions + 1)`) to one on the basis functions and 1
    /// (`any x (terms + 1)`).
    pub fn factor_of_terms<'a>(&self, factor: &'a Matrix) -> Cow<'a, Matrix> {
        let Some(combined) = &self.combined else { return Cow::Borrowed(factor) };
        let own: Vec<usize> = (0..self.len()).collect();
        let of_terms = multiply_transposed(&factor.select_columns(&own), combined);
        let (last, terms) = (self.len(), of_terms.columns());
        let entry =
            |i: usize, t: usize| if t < terms { of_terms[(i, t)] } else { factor[(i, last)] };
        Cow::Owned(Matrix::from_fn(factor.rows(), terms + 1, entry))
    }
}
