//! The covariance of the mean curve, factored without ever being formed.
//!
//! With `A = C + D` (`D` the noise of the means, both block-diagonal by series) the covariance of
//! the mean curve is `V = A - H S^-1 H' + F F'`. Twice Woodbury (Rasmussen and Williams 2006, A.3):
//!
//! ```text
//! B = A - H S^-1 H':   B^-1 = A^-1 + Y N^-1 Y',  Y = A^-1 H,  N = S - H'A^-1 H = (A^-1 D G)' H,
//! V = B + F F':        V^-1 = B^-1 - (B^-1 F) Q^-1 (B^-1 F)',  Q = I + F'B^-1 F,
//! log det V = log det A + log det N - log det S + log det Q.
//! ```

use lacuna::linalg::vector::{add_scaled, dot};
use lacuna::linalg::{self, Cholesky, Matrix};

use super::bias::{Bias, add};

/// See the module. Matrices have the rows of the measured outputs.
pub(super) struct Solved {
    /// `A` by series.
    pub blocks: Vec<Cholesky>,
    /// `C` by series.
    pub covariances: Vec<Matrix>,
    /// `H`.
    pub image: Matrix,
    /// `Y`.
    pub inverse_image: Matrix,
    /// `S` and `N`; `None` where the bias need not be orthogonal.
    pub inner: Option<(Cholesky, Cholesky)>,
    /// `B^-1 F`.
    pub inverse_factor: Matrix,
    /// `Q`.
    pub capacitance: Cholesky,
    /// `V^-1 d` for the residual `d` of the means.
    pub pull: Vec<f64>,
    /// `log det V + d' V^-1 d`.
    pub twice: f64,
}

impl Solved {
    /// The factors at a residual of the means, for these variances of the means.
    pub fn new(
        bias: &Bias,
        values: (&[f64], &[f64]),
        noise: &[f64],
        factor: &Matrix,
        residual: &[f64],
    ) -> Option<Self> {
        let (p, r, n) = (bias.basis.columns(), factor.columns(), residual.len());
        let covariances = bias.covariances(values);
        let mut blocks = Vec::with_capacity(covariances.len());
        // Columns: H, D G, F, d; and A^-1 times them.
        let width = 2 * p + r + 1;
        let (mut right, mut solved) = (Matrix::zeros(n, width), Matrix::zeros(n, width));
        let mut images = Vec::with_capacity(covariances.len());
        let mut twice = 0.0;
        for (block, covariance) in bias.blocks.iter().zip(&covariances) {
            let mut a = covariance.clone();
            for (k, &row) in block.rows.iter().enumerate() {
                a[(k, k)] += noise[row];
            }
            let a = Cholesky::new(&a).ok()?;
            let basis = bias.basis_of(block);
            let image = linalg::multiply(covariance, &basis);
            let columns = Matrix::from_fn(block.rows.len(), width, |k, j| {
                let row = block.rows[k];
                match j {
                    j if j < p => image[(k, j)],
                    j if j < 2 * p => noise[row] * basis[(k, j - p)],
                    j if j < 2 * p + r => factor[(row, j - 2 * p)],
                    _ => residual[row],
                }
            });
            let inverse = a.solve_matrix(&columns);
            for (k, &row) in block.rows.iter().enumerate() {
                right.row_mut(row).copy_from_slice(columns.row(k));
                solved.row_mut(row).copy_from_slice(inverse.row(k));
            }
            twice += a.log_determinant();
            images.push(image);
            blocks.push(a);
        }
        let pick =
            |m: &Matrix, from: usize, to: usize| m.select_columns(&(from..to).collect::<Vec<_>>());
        let (image, inverse_image) = (pick(&right, 0, p), pick(&solved, 0, p));
        let mut rest = pick(&solved, 2 * p, width);
        let inner = if p == 0 {
            None
        } else {
            let outer = bias.inner(&images)?;
            let reduced = linalg::transposed_multiply(&pick(&solved, p, 2 * p), &image);
            let reduced = Cholesky::new(&reduced).ok()?;
            let along = linalg::transposed_multiply(&inverse_image, &pick(&right, 2 * p, width));
            add(&mut rest, 1.0, &linalg::multiply(&inverse_image, &reduced.solve_matrix(&along)));
            twice += reduced.log_determinant() - outer.log_determinant();
            Some((outer, reduced))
        };
        let (inverse_factor, mut pull) = (pick(&rest, 0, r), rest.column(r));
        let mut capacitance = linalg::transposed_multiply(factor, &inverse_factor);
        for k in 0..r {
            capacitance[(k, k)] += 1.0;
        }
        let capacitance = Cholesky::new(&capacitance).ok()?;
        let mut zeta = linalg::transposed_multiply_vector(&inverse_factor, residual);
        capacitance.solve(&mut zeta);
        for (x, row) in pull.iter_mut().zip(inverse_factor.iter_rows()) {
            *x -= dot(row, &zeta);
        }
        twice += capacitance.log_determinant() + dot(residual, &pull);
        Some(Self {
            blocks,
            covariances,
            image,
            inverse_image,
            inner,
            inverse_factor,
            capacitance,
            pull,
            twice,
        })
    }

    /// `E` and `K` with `V^-1 = A^-1 + E E' - K K'`.
    pub fn corrections(&self) -> (Matrix, Matrix) {
        let half =
            |m: &Matrix, factor: &Cholesky| factor.whiten_matrix(&m.transposed()).transposed();
        let added = match &self.inner {
            Some((_, reduced)) => half(&self.inverse_image, reduced),
            None => Matrix::zeros(self.pull.len(), 0),
        };
        (added, half(&self.inverse_factor, &self.capacitance))
    }

    /// The inverses of the blocks of `A`.
    pub fn inverses(&self) -> Vec<Matrix> {
        self.blocks.iter().map(Cholesky::inverse).collect()
    }

    /// The diagonal of `V^-1`.
    pub fn diagonal(&self, bias: &Bias, inverses: &[Matrix]) -> Vec<f64> {
        let (added, taken) = self.corrections();
        let mut diagonal = vec![0.0; self.pull.len()];
        for (block, inverse) in bias.blocks.iter().zip(inverses) {
            for (k, &row) in block.rows.iter().enumerate() {
                let (e, t) = (added.row(row), taken.row(row));
                diagonal[row] = inverse[(k, k)] + dot(e, e) - dot(t, t);
            }
        }
        diagonal
    }

    /// Twice the derivative of the log density by the entries of `C`, by series:
    /// `P' (pull pull' - V^-1) P` with the projection `P = I - H S^-1 G'`.
    pub fn by_covariance(&self, bias: &Bias, inverses: &[Matrix]) -> Vec<Matrix> {
        let (mut added, mut taken) = self.corrections();
        let mut pull = Matrix::from_vec(self.pull.len(), 1, self.pull.clone());
        let mut cross = None;
        if let Some((outer, _)) = &self.inner {
            // P' X = X - G S^-1 (H' X).
            for x in [&mut added, &mut taken, &mut pull] {
                let along = outer.solve_matrix(&linalg::transposed_multiply(&self.image, x));
                add(x, -1.0, &linalg::multiply(&bias.basis, &along));
            }
            // P' A^-1 P = A^-1 - G (Y S^-1)' - (Y S^-1) G' + G (S^-1 H'Y S^-1) G'.
            let turned = outer.solve_matrix(&self.inverse_image.transposed()).transposed();
            let middle = linalg::transposed_multiply(&self.image, &turned);
            cross = Some((turned, outer.solve_matrix(&middle)));
        }
        let one = |(block, inverse): (&super::bias::Block, &Matrix)| {
            let rows = |m: &Matrix| m.select_rows(&block.rows);
            let (added, taken, pull) = (rows(&added), rows(&taken), rows(&pull));
            let mut by = inverse.clone();
            by.as_mut_slice().iter_mut().for_each(|x| *x = -*x);
            add(&mut by, 1.0, &linalg::multiply_transposed(&pull, &pull));
            add(&mut by, -1.0, &linalg::multiply_transposed(&added, &added));
            add(&mut by, 1.0, &linalg::multiply_transposed(&taken, &taken));
            if let Some((turned, middle)) = &cross {
                let (basis, turned) = (bias.basis_of(block), rows(turned));
                let outer = linalg::multiply_transposed(&basis, &turned);
                for i in 0..by.rows() {
                    let column = outer.column(i);
                    let row = by.row_mut(i);
                    add_scaled(row, 1.0, outer.row(i));
                    add_scaled(row, 1.0, &column);
                }
                let both = linalg::multiply_transposed(&linalg::multiply(&basis, middle), &basis);
                add(&mut by, -1.0, &both);
            }
            by
        };
        bias.blocks.iter().zip(inverses).map(one).collect()
    }
}
