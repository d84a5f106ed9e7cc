//! Factors of a covariance and a trend, from which all quantities of universal kriging follow.

use lacuna_linalg::{
    self, Cholesky, Matrix, gram_lower, multiply, solve_upper_matrix, thin_qr, transposed_multiply,
};

/// `K = L L'` and `L^-1 F = Q R`, with which the projection of universal kriging is
/// `P = K^-1 - K^-1 F (F' K^-1 F)^-1 F' K^-1 = L^-T (I - Q Q') L^-1`.
#[derive(Debug, Clone, PartialEq)]
pub struct Factor {
    /// `L^-1` (`N x N`).
    pub lower_inverse: Matrix,
    /// `Q` (`N x p`).
    pub q: Matrix,
    /// `R^-1` (`p x p`), upper triangular.
    pub r_inverse: Matrix,
    /// `log |K|`.
    pub log_determinant: f64,
    /// `log |F' K^-1 F|`.
    pub log_information: f64,
}

/// Solutions for a set of scores `Y`.
pub struct Weights {
    /// `P Y` (`N x C`).
    pub alpha: Matrix,
    /// Coefficients of the trend by generalised least squares (`p x C`).
    pub beta: Matrix,
    /// Diagonal of `Y' P Y`.
    pub squares: Vec<f64>,
}

/// Jitters added to the diagonal in turn if a covariance cannot be factored to working precision.
pub const JITTERS: [f64; 8] = [0.0, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8];

/// Factors of a whitened trend `L^-1 F = Q R`.
pub struct WhiteTrend {
    /// `Q` (`N x p`).
    pub q: Matrix,
    /// `R^-1` (`p x p`), upper triangular.
    pub r_inverse: Matrix,
    /// `log |F' K^-1 F|`.
    pub log_information: f64,
}

impl WhiteTrend {
    /// Factors `L^-1 F`; `None` if its columns are dependent.
    pub fn new(white: &Matrix) -> Option<Self> {
        let lacuna_linalg::Qr { q, r } = thin_qr(white).ok()?;
        let p = r.rows();
        let size = |i: usize| r[(i, i)].abs();
        let largest = (0..p).map(size).fold(0.0, f64::max);
        if p < white.columns() || (0..p).any(|i| size(i) <= 1e-12 * largest) {
            return None;
        }
        let mut r_inverse = Matrix::from_fn(p, p, |i, j| f64::from(u8::from(i == j)));
        solve_upper_matrix(&r, &mut r_inverse);
        let log_information = 2.0 * (0..p).map(|i| size(i).ln()).sum::<f64>();
        Some(Self { q, r_inverse, log_information })
    }
}

/// Returns `(I - Q Q') W` and `Q' W` for whitened scores `W`.
pub fn without(q: &Matrix, mut white: Matrix) -> (Matrix, Matrix) {
    let along = transposed_multiply(q, &white);
    let fitted = multiply(q, &along);
    white.as_mut_slice().iter_mut().zip(fitted.as_slice()).for_each(|(w, f)| *w -= f);
    (white, along)
}

/// Returns the sums of squares of the columns.
pub fn column_squares(matrix: &Matrix) -> Vec<f64> {
    let mut squares = vec![0.0; matrix.columns()];
    for row in matrix.iter_rows() {
        squares.iter_mut().zip(row).for_each(|(sum, w)| *sum += w * w);
    }
    squares
}

impl Factor {
    /// Factors a covariance (its lower triangle, of unit size) and a trend `F` (`N x p`); returns also the jitter
    /// that had to be added to the diagonal of the covariance. `None` if no jitter suffices or the columns of the
    /// trend are dependent.
    pub fn new(mut covariance: Matrix, trend: &Matrix) -> Option<(Self, f64)> {
        let mut added = 0.0;
        for jitter in JITTERS {
            for i in 0..covariance.rows() {
                covariance[(i, i)] += jitter - added;
            }
            added = jitter;
            if let Ok(cholesky) = Cholesky::new(&covariance) {
                return Some((Self::of(&cholesky, trend)?, jitter));
            }
        }
        None
    }

    fn of(cholesky: &Cholesky, trend: &Matrix) -> Option<Self> {
        let lower_inverse = cholesky.lower_inverse();
        let WhiteTrend { q, r_inverse, log_information } =
            WhiteTrend::new(&multiply(&lower_inverse, trend))?;
        let log_determinant = cholesky.log_determinant();
        Some(Self { lower_inverse, q, r_inverse, log_determinant, log_information })
    }

    /// Returns `log |K| + log |F' K^-1 F|`.
    pub fn determinants(&self) -> f64 {
        self.log_determinant + self.log_information
    }

    /// Returns `N - p`.
    pub fn free(&self) -> f64 {
        (self.size() - self.terms()) as f64
    }

    /// Returns `N`.
    pub fn size(&self) -> usize {
        self.lower_inverse.rows()
    }

    /// Returns `p`.
    pub fn terms(&self) -> usize {
        self.q.columns()
    }

    /// Returns `P Y`, the trend's coefficients and the squares for scores `Y` (`N x C`).
    pub fn weights(&self, scores: &Matrix) -> Weights {
        let (white, along) = self.split(scores);
        Weights {
            alpha: transposed_multiply(&self.lower_inverse, &white),
            beta: multiply(&self.r_inverse, &along),
            squares: column_squares(&white),
        }
    }

    /// Returns `(I - Q Q') L^-1 Y`; inner products of its columns are those with `P`.
    pub fn whitened(&self, scores: &Matrix) -> Matrix {
        self.split(scores).0
    }

    /// Returns `(I - Q Q') L^-1 Y` and `Q' L^-1 Y`.
    fn split(&self, scores: &Matrix) -> (Matrix, Matrix) {
        without(&self.q, multiply(&self.lower_inverse, scores))
    }

    /// Returns `B` with `K^-1 F (F' K^-1 F)^-1 F' K^-1 = B B'` (`N x p`).
    pub fn trend_directions(&self) -> Matrix {
        transposed_multiply(&self.lower_inverse, &self.q)
    }

    /// Returns `K^-1`.
    pub fn inverse(&self) -> Matrix {
        gram_lower(&self.lower_inverse)
    }

    /// Returns the diagonals of `P` and of `K^-1`.
    pub fn precisions(&self) -> Vec<(f64, f64)> {
        let n = self.size();
        let mut diagonal = vec![0.0; n];
        for row in self.lower_inverse.iter_rows() {
            diagonal.iter_mut().zip(row).for_each(|(sum, l)| *sum += l * l);
        }
        let directions = self.trend_directions();
        let taken = directions.iter_rows().map(|row| row.iter().map(|b| b * b).sum::<f64>());
        diagonal.into_iter().zip(taken).map(|(k, t)| (k - t, k)).collect()
    }
}
