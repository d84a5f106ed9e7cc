//! Fits of all outputs or components as one expansion.

use lacuna::plugin::surrogate::FitError;
use lacuna_linalg::{Matrix, multiply_transposed};

use super::emulator::{Expansion, Reduction, Summary};
use super::errors::Errors;
use super::functions::Functions;
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
    /// Returns the expansion of the outputs.
    pub fn expansion(self) -> Expansion {
        let fit_error = FitError { relative: self.relative, residuals: self.residuals };
        let errors = Errors::OfOutputs(fit_error);
        Expansion::new(Functions::of(self.terms), self.coefficients, errors, self.summary)
    }

    /// Converts an expansion of components to one of the outputs. The part of the outputs that the components leave
    /// out is included in the residuals, and hence in all statements about the emulator's error.
    ///
    /// With fewer components than half of the terms the outputs stay combinations of the components.
    pub fn multiplied_back(self, variances: &[f64], components: PrincipalComponents) -> Expansion {
        let PrincipalComponents { mean, directions, scores, remainder, truncation } = components;
        let corrected = self.corrected(&scores);
        let few = remainder.is_none() || 2 * (scores.columns() + 1) < self.terms.terms().len();
        let errors = if let Some(remainder) = remainder {
            let relative = relative_of_outputs(&corrected, variances, &directions, &remainder);
            let residuals = added(remainder, &self.residuals, &directions);
            Errors::OfOutputs(FitError { relative, residuals })
        } else {
            let sizes = (variances, &truncation[..]);
            Errors::of_components(self.residuals, &corrected, &directions, sizes)
        };
        let total: f64 = variances.iter().sum();
        let reduction = Reduction {
            components: scores.columns(),
            left_out: truncation.iter().sum::<f64>() / total.max(f64::MIN_POSITIVE),
        };
        let summary = Summary {
            constant: variances.iter().filter(|v| **v == 0.0).count(),
            poor: errors.relative().iter().filter(|e| **e >= 1.0).count(),
            reduction: Some(reduction),
            ..self.summary
        };
        if few {
            let functions = Functions::with_constant(self.terms, &self.coefficients);
            let coefficients = beside(mean, &directions);
            return Expansion::new(functions, coefficients, errors, summary);
        }
        let mut coefficients = multiply_transposed(&self.coefficients, &directions);
        // The constant is the first term of every set.
        coefficients.row_mut(0).iter_mut().zip(&mean).for_each(|(c, m)| *c += m);
        Expansion::new(Functions::of(self.terms), coefficients, errors, summary)
    }

    /// Returns the residuals of the components times the correction for the number of terms, which differs between
    /// components.
    fn corrected(&self, scores: &Matrix) -> Matrix {
        let square = |column: Vec<f64>| column.iter().map(|x| x * x).sum::<f64>();
        let corrections: Vec<f64> = (0..scores.columns())
            .map(|k| {
                let plain = square(self.residuals.column(k));
                let corrected = self.relative[k] * square(scores.column(k));
                if plain > 0.0 { (corrected / plain).sqrt() } else { 1.0 }
            })
            .collect();
        Matrix::from_fn(self.residuals.rows(), corrections.len(), |i, k| {
            self.residuals[(i, k)] * corrections[k]
        })
    }
}

/// Returns the mean, then the directions of the components, one per row.
fn beside(mean: Vec<f64>, directions: &Matrix) -> Matrix {
    let mut rows = Matrix::from_vec(1, mean.len(), mean);
    rows.reserve_rows(directions.columns());
    for k in 0..directions.columns() {
        rows.extend_row(directions.iter_rows().map(|row| row[k]));
    }
    rows
}

/// Returns the error of each output relative to its variance.
fn relative_of_outputs(
    corrected: &Matrix,
    variances: &[f64],
    directions: &Matrix,
    remainder: &Matrix,
) -> Vec<f64> {
    let runs = corrected.rows();
    let mut squares = vec![0.0; variances.len()];
    for first in (0..runs).step_by(BLOCK) {
        let block: Vec<usize> = (first..runs.min(first + BLOCK)).collect();
        let back = multiply_transposed(&corrected.select_rows(&block), directions);
        for (&i, row) in block.iter().zip(back.iter_rows()) {
            let errors = row.iter().zip(remainder.row(i)).map(|(x, e)| x + e);
            squares.iter_mut().zip(errors).for_each(|(sum, e)| *sum += e * e);
        }
    }
    (squares.iter().zip(variances))
        .map(|(sum, &v)| if v > 0.0 { sum / runs as f64 / v } else { 0.0 })
        .collect()
}

/// Adds the product of scores and directions to a remainder.
fn added(mut remainder: Matrix, scores: &Matrix, directions: &Matrix) -> Matrix {
    let runs = remainder.rows();
    for first in (0..runs).step_by(BLOCK) {
        let block: Vec<usize> = (first..runs.min(first + BLOCK)).collect();
        let product = multiply_transposed(&scores.select_rows(&block), directions);
        for (&i, row) in block.iter().zip(product.iter_rows()) {
            remainder.row_mut(i).iter_mut().zip(row).for_each(|(e, x)| *e += x);
        }
    }
    remainder
}
