//! Covariance of the mean curve, factored without being formed.
//!
//! With `A = C + D` (`D` the noise of the means, both block-diagonal by series) the covariance of the mean curve is
//! `V = A - H S^-1 H' + F F'`. Applying Woodbury's identity twice (Rasmussen and Williams 2006, A.3):
//!
//! ```text
//! B = A - H S^-1 H':   B^-1 = A^-1 + Y N^-1 Y',  Y = A^-1 H,  N = S - H'A^-1 H = (A^-1 D G)' H,
//! V = B + F F':  V^-1 = B^-1 - (B^-1 F) Q^-1 (B^-1 F)',  Q = I + F'B^-1 F,
//! log det V = log det A + log det N - log det S + log det Q.
//! ```
//!
//! Columns whitened by the [filter](super::filter) of `A`, extended below by rows whitened with `N^-1/2 Y'`, have the
//! inner products of `B^-1`; the quadratic form is then a sum of squares.

use lacuna_linalg::vector::{add_scaled, dot};
use lacuna_linalg::{Cholesky, Matrix};

use super::bias::Bias;
use super::filter::Filter;

/// The factors at one response and one set of hyperparameters (see the module). Matrices have one row per measured
/// output.
pub(super) struct Solved<'a> {
    pub bias: &'a Bias,
    /// Standard deviations and correlation lengths by group.
    pub values: (&'a [f64], &'a [f64]),
    /// Variance of the noise of the means.
    pub noise: Vec<f64>,
    pub factor: &'a Matrix,
    /// Residual of the means.
    pub residual: Vec<f64>,
    /// `A` by series.
    pub filters: Vec<Filter>,
    /// `C` by series, and its derivative with respect to the length.
    pub covariances: Vec<Option<[Matrix; 2]>>,
    /// `H`, `S` and `N`; `None` if the bias need not be orthogonal.
    pub inner: Option<Inner>,
    /// `F` whitened with `B`.
    pub white: Matrix,
    /// `Q`.
    pub capacitance: Cholesky,
    /// Weights of the common errors that explain the residual best.
    pub zeta: Vec<f64>,
    /// `log det V + d' V^-1 d` for the residual `d`.
    pub twice: f64,
}

/// Matrices of the orthogonality condition.
pub(super) struct Inner {
    /// `H`, plain and whitened with `A`.
    pub image: Matrix,
    pub white: Matrix,
    /// Factors of `S` and `N`.
    pub outer: Cholesky,
    pub reduced: Cholesky,
}

impl Inner {
    /// Computes the matrices from `H` and the filters of `A`.
    fn new(bias: &Bias, image: Matrix, filters: &[Filter], noise: &[f64]) -> Option<Self> {
        let basis = &bias.basis;
        let outer = Cholesky::new(&lacuna_linalg::transposed_multiply(basis, &image)).ok()?;
        let p = basis.columns();
        let mut both = Matrix::from_fn(basis.rows(), 2 * p, |i, j| {
            if j < p { image[(i, j)] } else { noise[i] * basis[(i, j - p)] }
        });
        whiten(bias, filters, &mut both);
        let split = |from: usize| both.select_columns(&(from..from + p).collect::<Vec<_>>());
        let (white, noisy) = (split(0), split(p));
        let reduced = Cholesky::new(&lacuna_linalg::transposed_multiply(&noisy, &white)).ok()?;
        Some(Self { image, white, outer, reduced })
    }
}

/// Whitens the rows of each series with its filter.
fn whiten(bias: &Bias, filters: &[Filter], columns: &mut Matrix) {
    for (block, filter) in bias.blocks.iter().zip(filters) {
        filter.whiten(&block.rows, columns);
    }
}

/// Whitens columns with `B`; `below` rows are appended, one for each direction to which the bias is orthogonal.
fn whitened(
    bias: &Bias,
    filters: &[Filter],
    inner: Option<&Inner>,
    columns: &Matrix,
    below: usize,
) -> Matrix {
    let (n, r) = (columns.rows(), columns.columns());
    let mut white = Matrix::zeros(n + below, r);
    white.as_mut_slice()[..n * r].copy_from_slice(columns.as_slice());
    whiten(bias, filters, &mut white);
    let Some(inner) = inner else { return white };
    let mut along = Matrix::zeros(below, r);
    for (row, weights) in white.iter_rows().zip(inner.white.iter_rows()) {
        for (k, &weight) in weights.iter().enumerate() {
            add_scaled(along.row_mut(k), weight, row);
        }
    }
    let along = inner.reduced.whiten_matrix(&along);
    white.as_mut_slice()[n * r..].copy_from_slice(along.as_slice());
    white
}

impl<'a> Solved<'a> {
    /// Computes the factors for a residual of the means and the variances of the means; `None` if a matrix cannot be
    /// factored.
    pub fn new(
        bias: &'a Bias,
        values: (&'a [f64], &'a [f64]),
        noise: Vec<f64>,
        factor: &'a Matrix,
        residual: Vec<f64>,
    ) -> Option<Self> {
        let mut filters = Vec::with_capacity(bias.blocks.len());
        for block in &bias.blocks {
            let own = block.rows.iter().map(|&row| noise[row]);
            filters.push(Filter::new(bias.kernel, &block.grid, block.of(values), own)?);
        }
        let mut twice: f64 = filters.iter().map(Filter::log_determinant).sum();
        let covariances = bias.covariances(values);
        let inner = if bias.basis.columns() == 0 {
            None
        } else {
            let inner = Inner::new(bias, bias.image(&covariances), &filters, &noise)?;
            twice += inner.reduced.log_determinant() - inner.outer.log_determinant();
            Some(inner)
        };
        let below = inner.as_ref().map_or(0, |inner| inner.white.columns());
        let white = whitened(bias, &filters, inner.as_ref(), factor, below);
        let column = Matrix::from_vec(residual.len(), 1, residual.clone());
        let last = whitened(bias, &filters, inner.as_ref(), &column, below).into_vec();
        let r = factor.columns();
        let mut capacitance = lacuna_linalg::gram(&white);
        (0..r).for_each(|k| capacitance[(k, k)] += 1.0);
        let capacitance = Cholesky::new(&capacitance).ok()?;
        let mut zeta = lacuna_linalg::transposed_multiply_vector(&white, &last);
        capacitance.solve(&mut zeta);
        for (x, row) in last.iter().zip(white.iter_rows()) {
            twice += (x - dot(row, &zeta)).powi(2);
        }
        twice += dot(&zeta, &zeta) + capacitance.log_determinant();
        Some(Self {
            bias,
            values,
            noise,
            factor,
            residual,
            filters,
            covariances,
            inner,
            white,
            capacitance,
            zeta,
            twice,
        })
    }

    /// Replaces `X`, whitened with `A`, by `A^-1 X`.
    pub fn back(&self, columns: &mut Matrix) {
        for (block, filter) in self.bias.blocks.iter().zip(&self.filters) {
            filter.back(&block.rows, columns);
        }
    }

    /// Returns `V^-1 d = B^-1 (d - F zeta)`.
    pub fn pull(&self, added: &Matrix) -> Vec<f64> {
        let rest: Vec<f64> = (self.residual.iter().zip(self.factor.iter_rows()))
            .map(|(d, row)| d - dot(row, &self.zeta))
            .collect();
        let mut column = Matrix::from_vec(rest.len(), 1, rest);
        whiten(self.bias, &self.filters, &mut column);
        let along = self.inner.as_ref().map(|inner| {
            let mut along =
                lacuna_linalg::transposed_multiply_vector(&inner.white, column.as_slice());
            inner.reduced.whiten(&mut along);
            along
        });
        self.back(&mut column);
        let mut pull = column.into_vec();
        if let Some(along) = along {
            add_scaled(&mut pull, 1.0, &lacuna_linalg::multiply_vector(added, &along));
        }
        pull
    }
}
