//! Ordinary least squares with leave-one-out errors.

use lacuna_linalg::{
    Matrix, multiply_transposed, multiply_vector, solve_upper, solve_upper_matrix, thin_qr,
    transposed_multiply_vector,
};

use super::by_run::Blocks;
use super::judge::{Criterion, correction, left_out};

/// Regression on a fixed set of basis functions, factored once for any number of outputs.
pub(super) struct Regression {
    q: Matrix,
    r: Matrix,
    /// Diagonal of the hat matrix.
    leverage: Vec<f64>,
    /// Correction for the number of terms.
    correction: f64,
    /// Runs of each fold and their block of `1 - H`, with `H` the hat matrix.
    folds: Vec<(Vec<usize>, Matrix)>,
    /// Blocks of the runs, if their slopes are among the rows.
    by_run: Option<Blocks>,
}

/// Regression of one output.
pub(super) struct Fit {
    /// Coefficient of each basis function.
    pub coefficients: Vec<f64>,
    /// Error by the criterion, relative to the output's variance.
    pub relative: f64,
    /// Leave-one-out residuals of the values: `r_i / (1 - h_i)` without slopes.
    pub residuals: Vec<f64>,
}

impl Regression {
    /// Factors the basis functions at the runs (`runs x terms`, with slopes `rows x terms`); `None` if they are linearly dependent to working
    /// precision.
    pub fn new(basis: &Matrix, criterion: &Criterion) -> Option<Self> {
        let (n, p) = (basis.rows(), basis.columns());
        let qr = thin_qr(basis).ok()?;
        let largest = (0..p).map(|i| qr.r[(i, i)].abs()).fold(0.0, f64::max);
        let floor = largest * f64::EPSILON * n as f64;
        if p > n || (0..p).any(|i| qr.r[(i, i)].abs() <= floor) {
            return None;
        }
        let mut inverse = Matrix::from_fn(p, p, |i, j| f64::from(u8::from(i == j)));
        solve_upper_matrix(&qr.r, &mut inverse);
        let trace = inverse.as_slice().iter().map(|x| x * x).sum();
        let leverage = qr.q.iter_rows().map(|row| row.iter().map(|x| x * x).sum()).collect();
        let folds = match criterion {
            Criterion::LeaveOneOut | Criterion::ByRun { .. } => Vec::new(),
            Criterion::Folds(folds) => folds.iter().map(|fold| block(&qr.q, fold)).collect(),
        };
        let by_run = match criterion {
            Criterion::ByRun { runs, .. } => Some(Blocks::of(&qr.q, *runs)),
            _ => None,
        };
        let known = match criterion {
            Criterion::ByRun { known, .. } => *known,
            _ => n,
        };
        let correction = correction(known, p, trace);
        Some(Self { q: qr.q, r: qr.r, leverage, correction, folds, by_run })
    }

    /// Fits one output, given as its mean and the deviations from it (`centred`, followed by its slopes if there are
    /// any); `variance` is that of its values, with divisor `N`. The first basis function must be the constant 1: it takes the mean, so that a large mean
    /// costs no digits.
    pub fn fit(&self, mean: f64, centred: &[f64], variance: f64) -> Fit {
        let mut coefficients = transposed_multiply_vector(&self.q, centred);
        let model = multiply_vector(&self.q, &coefficients);
        solve_upper(&self.r, &mut coefficients);
        coefficients[0] += mean;
        let plain = || centred.iter().zip(&model).map(|(y, m)| y - m);
        let residuals: Vec<f64> = match &self.by_run {
            Some(blocks) => blocks.left_out(&plain().collect::<Vec<f64>>()),
            None => plain().zip(&self.leverage).map(|(r, h)| r / (1.0 - h)).collect(),
        };
        let relative = if self.folds.is_empty() {
            let squares = residuals.iter().map(|r| r * r).sum::<f64>() / residuals.len() as f64;
            squares / variance * self.correction
        } else {
            let plain: Vec<f64> = plain().collect();
            let squares = self.folds.iter().map(|(runs, block)| left_out(runs, block, &plain));
            squares.sum::<f64>() / centred.len() as f64 / variance
        };
        Fit {
            coefficients,
            relative: if relative.is_nan() { f64::INFINITY } else { relative },
            residuals,
        }
    }
}

/// Returns the runs of a fold and their block of `1 - H`.
fn block(q: &Matrix, fold: &[usize]) -> (Vec<usize>, Matrix) {
    let own = q.select_rows(fold);
    let hat = multiply_transposed(&own, &own);
    let m = fold.len();
    let part = Matrix::from_fn(m, m, |i, j| f64::from(u8::from(i == j)) - hat[(i, j)]);
    (fold.to_vec(), part)
}
