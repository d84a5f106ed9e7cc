//! Leave-one-out errors of an expansion.

use std::sync::OnceLock;

use lacuna::plugin::surrogate::FitError;
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::dot;

/// Errors of all outputs; or those of few components, from which the others follow.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Errors {
    /// Errors by run and output.
    OfOutputs(FitError),
    /// Errors by run and component.
    OfComponents(OfComponents),
}

/// Errors of components, of outputs that are the constant plus combinations of the components.
#[derive(Debug, Clone)]
pub(super) struct OfComponents {
    /// Error of each output relative to its variance.
    pub relative: Vec<f64>,
    /// Leave-one-out residuals of the components (`runs x components`).
    pub residuals: Matrix,
    /// Factor on the residuals of each output: their mean square includes what the components leave out.
    pub factors: Vec<f64>,
    /// Residuals of all outputs; made when they are asked for.
    whole: OnceLock<FitError>,
}

impl PartialEq for OfComponents {
    fn eq(&self, other: &Self) -> bool {
        let own = (&self.relative, &self.residuals, &self.factors);
        own == (&other.relative, &other.residuals, &other.factors)
    }
}

impl OfComponents {
    pub fn new(relative: Vec<f64>, residuals: Matrix, factors: Vec<f64>) -> Self {
        Self { relative, residuals, factors, whole: OnceLock::new() }
    }

    /// Returns the residuals of some runs and outputs; `coefficients` are those of the constant and the components
    /// (`(1 + components) x outputs`).
    fn at(&self, coefficients: &Matrix, runs: &[usize], outputs: &[usize]) -> Matrix {
        let mut all = Matrix::zeros(runs.len(), outputs.len());
        for (i, &run) in runs.iter().enumerate() {
            let row = all.row_mut(i);
            for (component, residual) in self.residuals.row(run).iter().enumerate() {
                let direction = coefficients.row(component + 1);
                row.iter_mut().zip(outputs).for_each(|(e, &j)| *e += residual * direction[j]);
            }
            row.iter_mut().zip(outputs).for_each(|(e, &j)| *e *= self.factors[j]);
        }
        all
    }
}

impl Errors {
    /// Returns the errors of outputs whose components have these residuals (`runs x components`), relative errors, and
    /// variances over the runs; the directions of the components are the columns of `directions`.
    pub fn of_components(
        residuals: Matrix,
        corrected: &Matrix,
        directions: &Matrix,
        (variances, truncation): (&[f64], &[f64]),
    ) -> Self {
        let runs = residuals.rows() as f64;
        let products = |m: &Matrix| lacuna_linalg::transposed_multiply(m, m);
        let (plain, corrected) = (products(&residuals), products(corrected));
        let mean_square = |products: &Matrix, direction: &[f64]| {
            let rows = products.iter_rows().zip(direction);
            (rows.map(|(row, v)| v * dot(row, direction)).sum::<f64>() / runs).max(0.0)
        };
        let mut relative = Vec::with_capacity(variances.len());
        let mut factors = Vec::with_capacity(variances.len());
        for (j, direction) in directions.iter_rows().enumerate() {
            let (own, left) = (mean_square(&plain, direction), truncation[j]);
            factors.push(if own > 0.0 { ((own + left) / own).sqrt() } else { 1.0 });
            let whole = mean_square(&corrected, direction) + left;
            relative.push(if variances[j] > 0.0 { whole / variances[j] } else { 0.0 });
        }
        Self::OfComponents(OfComponents::new(relative, residuals, factors))
    }

    /// Returns the error of each output relative to its variance.
    pub fn relative(&self) -> &[f64] {
        match self {
            Self::OfOutputs(errors) => &errors.relative,
            Self::OfComponents(errors) => &errors.relative,
        }
    }

    /// Returns the residuals by run and output, or by run and component.
    pub fn residuals(&self) -> &Matrix {
        match self {
            Self::OfOutputs(errors) => &errors.residuals,
            Self::OfComponents(errors) => &errors.residuals,
        }
    }

    /// Returns the residuals of some runs and outputs.
    pub fn at(&self, coefficients: &Matrix, runs: &[usize], outputs: &[usize]) -> Matrix {
        match self {
            Self::OfOutputs(errors) => errors.residuals.select(runs, outputs),
            Self::OfComponents(errors) => errors.at(coefficients, runs, outputs),
        }
    }

    /// Returns the errors of all runs and outputs.
    pub fn whole(&self, coefficients: &Matrix) -> &FitError {
        match self {
            Self::OfOutputs(errors) => errors,
            Self::OfComponents(errors) => errors.whole.get_or_init(|| {
                let runs: Vec<usize> = (0..errors.residuals.rows()).collect();
                let outputs: Vec<usize> = (0..coefficients.columns()).collect();
                let residuals = errors.at(coefficients, &runs, &outputs);
                FitError { relative: errors.relative.clone(), residuals }
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna_linalg::multiply_transposed;

    /// The errors of outputs that are combinations of components, written out: products with the directions, whose mean
    /// square and what is left out add up.
    #[test]
    fn errors_of_outputs_follow_from_those_of_components() {
        let wave = |rows, columns, s: f64| {
            Matrix::from_fn(rows, columns, |i, j| (s * (7 * i + 3 * j * j + 1) as f64).sin())
        };
        let (residuals, corrected, directions) =
            (wave(9, 3, 1.0), wave(9, 3, 1.3), wave(5, 3, 0.7));
        let (variances, truncation) = ([2.0, 3.0, 0.0, 1.0, 5.0], [0.1, 0.0, 0.0, 0.7, 0.2]);
        let errors = Errors::of_components(
            residuals.clone(),
            &corrected,
            &directions,
            (&variances, &truncation),
        );
        let mut coefficients = Matrix::zeros(1, 5);
        directions.transposed().iter_rows().for_each(|row| coefficients.push_row(row));
        let mean_square =
            |m: &Matrix, j: usize| m.column(j).iter().map(|x| x * x).sum::<f64>() / 9.0;
        let (plain, enlarged) = (
            multiply_transposed(&residuals, &directions),
            multiply_transposed(&corrected, &directions),
        );
        let whole = errors.whole(&coefficients);
        for j in 0..5 {
            let expected = mean_square(&plain, j) + truncation[j];
            assert!((mean_square(&whole.residuals, j) - expected).abs() < 1e-12);
            let relative = match variances[j] {
                0.0 => 0.0,
                variance => (mean_square(&enlarged, j) + truncation[j]) / variance,
            };
            assert!((errors.relative()[j] - relative).abs() < 1e-12);
            let ratio = whole.residuals[(4, j)] / plain[(4, j)];
            assert!((ratio - (expected / mean_square(&plain, j)).sqrt()).abs() < 1e-10);
        }
        let some = errors.at(&coefficients, &[4, 2], &[3, 0]);
        assert_eq!(some, whole.residuals.select(&[4, 2], &[3, 0]));
    }
}
