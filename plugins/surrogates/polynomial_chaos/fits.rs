//! Fits of all outputs or components as one expansion.

use lacuna::plugin::surrogate::FitError;
use lacuna_linalg::{Matrix, multiply_transposed};

use super::emulator::{Expansion, Reduction, Summary};
use super::terms::Basis;
use crate::surrogates::principal_components::PrincipalComponents;

/// Number of runs whose enlarged residuals are in memory at a time.
const BLOCK: usize = 64;

/// Fits of all outputs, or of all components, side by side.
pub(super) struct Fits {
    pub terms: Basis,
    /// Coefficients (`terms x outputs`).
    pub coefficients: Matrix,
    /// Error of each output relative to its variance.
    pub relative: Vec<f64>,
    /// Leave-one-out residuals (`runs x outputs`).
    pub residuals: Matrix,
    pub summary: Summary,
}

impl Fits {
    /// Returns the expansion of the outputs; `reduction` tells of components that were fitted in their place.
    pub fn expansion(self, reduction: Option<Reduction>) -> Expansion {
        let fit_error = FitError { relative: self.relative, residuals: self.residuals };
        let summary = Summary { reduction, ..self.summary };
        Expansion::new(self.terms, self.coefficients, fit_error, summary)
    }

    /// Converts an expansion of components to one of the outputs. The part of the outputs that the components leave
    /// out is included in the residuals, and hence in all statements about the emulator's error.
    pub fn multiplied_back(self, variances: &[f64], components: &PrincipalComponents) -> Expansion {
        let PrincipalComponents { mean, directions, scores, remainder } = components;
        let runs = self.residuals.rows();
        let mut coefficients = multiply_transposed(&self.coefficients, directions);
        // The constant is the first term of every set.
        coefficients.row_mut(0).iter_mut().zip(mean).for_each(|(c, m)| *c += m);
        let square = |column: Vec<f64>| column.iter().map(|x| x * x).sum::<f64>();
        // The correction for the number of terms differs between components.
        let corrections: Vec<f64> = (0..scores.columns())
            .map(|k| {
                let plain = square(self.residuals.column(k));
                let corrected = self.relative[k] * square(scores.column(k));
                if plain > 0.0 { (corrected / plain).sqrt() } else { 1.0 }
            })
            .collect();
        let corrected =
            Matrix::from_fn(runs, scores.columns(), |i, k| self.residuals[(i, k)] * corrections[k]);
        let back = |scores: &Matrix, first: usize| {
            let mut product = multiply_transposed(scores, directions);
            for i in 0..product.rows() {
                let left_out = remainder.row(first + i);
                product.row_mut(i).iter_mut().zip(left_out).for_each(|(x, e)| *x += e);
            }
            product
        };
        let mut squares = vec![0.0; variances.len()];
        for first in (0..runs).step_by(BLOCK) {
            let block: Vec<usize> = (first..runs.min(first + BLOCK)).collect();
            for row in back(&corrected.select_rows(&block), first).iter_rows() {
                squares.iter_mut().zip(row).for_each(|(sum, e)| *sum += e * e);
            }
        }
        let relative: Vec<f64> = (squares.iter().zip(variances))
            .map(|(sum, &v)| if v > 0.0 { sum / runs as f64 / v } else { 0.0 })
            .collect();
        let residuals = back(&self.residuals, 0);
        let total: f64 = variances.iter().sum();
        let reduction = Reduction {
            components: scores.columns(),
            left_out: components.truncation().iter().sum::<f64>() / total.max(f64::MIN_POSITIVE),
        };
        let summary = Summary {
            constant: variances.iter().filter(|v| **v == 0.0).count(),
            poor: relative.iter().filter(|e| **e >= 1.0).count(),
            ..self.summary
        };
        Fits { coefficients, relative, residuals, summary, ..self }.expansion(Some(reduction))
    }
}
