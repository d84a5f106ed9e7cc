//! Symmetric matrices of the three random effects of whole replicates. They are factorised in each step of each fit of the noise,
//! where matrices of any size would mostly manage memory.

/// A matrix by rows.
pub(super) type Square = [[f64; 3]; 3];

/// The matrix with these entries.
pub(super) fn square(entry: impl Fn(usize, usize) -> f64) -> Square {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| entry(i, j)))
}

/// The scalar product.
pub(super) fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Cholesky's factor of a positive definite matrix `A = L L'`.
pub(super) struct Factor(Square);

impl Factor {
    /// The factor; `None` if the matrix is not positive definite.
    pub fn new(a: &Square) -> Option<Self> {
        let mut lower = [[0.0; 3]; 3];
        for j in 0..3 {
            let pivot = a[j][j] - dot(&lower[j], &lower[j]);
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            lower[j][j] = pivot.sqrt();
            for i in j + 1..3 {
                lower[i][j] = (a[i][j] - dot(&lower[i], &lower[j])) / lower[j][j];
            }
        }
        Some(Self(lower))
    }

    /// `L^-1 b`.
    fn forward(&self, b: [f64; 3]) -> [f64; 3] {
        let mut x = [0.0; 3];
        for i in 0..3 {
            x[i] = (b[i] - dot(&self.0[i], &x)) / self.0[i][i];
        }
        x
    }

    /// `A^-1 b`.
    pub fn solve(&self, b: [f64; 3]) -> [f64; 3] {
        let y = self.forward(b);
        let mut x = [0.0; 3];
        for i in (0..3).rev() {
            let column = [0, 1, 2].map(|k| self.0[k][i]);
            x[i] = (y[i] - dot(&column, &x)) / self.0[i][i];
        }
        x
    }

    /// `A^-1`, exactly symmetric.
    pub fn inverse(&self) -> Square {
        let columns =
            [0, 1, 2].map(|k| self.forward([0, 1, 2].map(|i| f64::from(u8::from(i == k)))));
        square(|i, j| dot(&columns[i], &columns[j]))
    }

    /// The logarithm of the determinant of `A`.
    pub fn log_determinant(&self) -> f64 {
        2.0 * (0..3).map(|i| self.0[i][i].ln()).sum::<f64>()
    }

    /// `b' A^-1 b`.
    pub fn quadratic(&self, b: [f64; 3]) -> f64 {
        let x = self.forward(b);
        dot(&x, &x)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lacuna_linalg::{Cholesky, Matrix};

    /// Against the factorisation of matrices of any size.
    #[test]
    fn it_is_the_factorisation_of_any_matrix() {
        let a = [[4.0, 1.0, -0.5], [1.0, 3.0, 0.7], [-0.5, 0.7, 2.0]];
        let (own, known) = (
            Factor::new(&a).unwrap(),
            Cholesky::new(&Matrix::from_fn(3, 3, |i, j| a[i][j])).unwrap(),
        );
        let b = [0.3, -1.2, 2.5];
        let mut x = b.to_vec();
        known.solve(&mut x);
        let (solved, inverse, expected) = (own.solve(b), own.inverse(), known.inverse());
        for i in 0..3 {
            assert!((solved[i] - x[i]).abs() < 1e-14, "{solved:?} {x:?}");
            assert!((0..3).all(|j| (inverse[i][j] - expected[(i, j)]).abs() < 1e-14));
        }
        assert!((own.log_determinant() - known.log_determinant()).abs() < 1e-14);
        assert!((own.quadratic(b) - known.quadratic(&b)).abs() < 1e-13);
        for bad in [[[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [[f64::NAN; 3]; 3]] {
            assert!(Factor::new(&bad).is_none());
        }
    }
}
