//! Correlation functions of distance.

use lacuna_linalg::Matrix;
use lacuna_linalg::radial::{exponentials, polynomials, squared_distances};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Correlation of two points as a function of `r`, the length of their difference measured in length scales
/// (Rasmussen and Williams 2006, section 4.2.1).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Kernel {
    /// `(1 + sqrt(5) r + 5 r^2 / 3) exp(-sqrt(5) r)`: twice differentiable responses. The usual choice for
    /// simulators.
    #[default]
    #[serde(rename = "matern_5_2")]
    Matern52,
    /// `(1 + sqrt(3) r) exp(-sqrt(3) r)`: once differentiable responses.
    #[serde(rename = "matern_3_2")]
    Matern32,
    /// `exp(-r^2 / 2)`: infinitely differentiable responses. The most accurate choice if the response is that smooth,
    /// and overconfident if it is not.
    #[serde(rename = "squared_exponential")]
    SquaredExponential,
}

impl Kernel {
    /// Returns the name of the kernel in a study.
    pub fn name(self) -> &'static str {
        match self {
            Self::Matern52 => "matern_5_2",
            Self::Matern32 => "matern_3_2",
            Self::SquaredExponential => "squared_exponential",
        }
    }

    /// Replaces squared distances `r^2` by correlations `c(r)`, and fills `slopes` with `-c'(r) / r`: the derivative
    /// with respect to the logarithm of a length scale, divided by that coordinate's contribution to `r^2`.
    pub(super) fn evaluate(self, squares: &mut [f64], slopes: &mut [f64]) {
        let rate = match self {
            Self::Matern52 => 5.0,
            Self::Matern32 => 3.0,
            Self::SquaredExponential => {
                for (slope, square) in slopes.iter_mut().zip(&*squares) {
                    *slope = -0.5 * square;
                }
                exponentials(slopes);
                squares.copy_from_slice(slopes);
                return;
            }
        };
        for (slope, square) in slopes.iter_mut().zip(&mut *squares) {
            *square = (rate * *square).sqrt();
            *slope = -*square;
        }
        exponentials(slopes);
        let matern52 = self == Self::Matern52;
        for (slope, square) in slopes.iter_mut().zip(squares) {
            let (a, decay) = (*square, *slope);
            if matern52 {
                *square = (1.0 + a + a * a / 3.0) * decay;
                *slope = 5.0 / 3.0 * (1.0 + a) * decay;
            } else {
                *square = (1.0 + a) * decay;
                *slope = 3.0 * decay;
            }
        }
    }

    /// Returns the correlations among points (one per column, in length scales) and their slopes, below the diagonal;
    /// the diagonal of the correlations is `1 + nugget`.
    pub fn among(self, points: &Matrix, nugget: f64) -> (Matrix, Matrix) {
        let n = points.columns();
        let (mut correlations, mut slopes) = (Matrix::zeros(n, n), Matrix::zeros(n, n));
        let mut point = vec![0.0; points.rows()];
        for i in 0..n {
            (0..points.rows()).for_each(|k| point[k] = points[(k, i)]);
            let row = &mut correlations.row_mut(i)[..=i];
            squared_distances(&point, points, &mut row[..i]);
            self.evaluate(&mut row[..i], &mut slopes.row_mut(i)[..i]);
            row[i] = 1.0 + nugget;
        }
        (correlations, slopes)
    }

    /// Returns the correlations of some points (one per column) with others (`points x others`).
    pub fn between(self, points: &Matrix, others: &Matrix) -> Matrix {
        let mut correlations = Matrix::zeros(points.columns(), others.columns());
        let mut slopes = vec![0.0; others.columns()];
        for i in 0..points.columns() {
            let row = correlations.row_mut(i);
            squared_distances(&points.column(i), others, row);
            self.evaluate(row, &mut slopes);
        }
        correlations
    }

    /// Returns the correlations of some points (one per column) with others, minus 1 (`points x others`).
    ///
    /// The weights of smooth responses are large and of both signs, so that in their sum with the correlations the
    /// ones cancel and leave rounding errors. For near points these differences are accurate to the last digit.
    pub fn above_one(self, points: &Matrix, others: &Matrix) -> Matrix {
        let mut above = Matrix::zeros(points.columns(), others.columns());
        let mut slopes = vec![0.0; others.columns()];
        let series = self.series();
        for i in 0..points.columns() {
            let row = above.row_mut(i);
            squared_distances(&points.column(i), others, row);
            let farthest = row.iter().fold(0.0_f64, |most, s| if *s > most { *s } else { most });
            if self.argument(farthest) < 1.0 {
                for square in row.iter_mut() {
                    *square = self.argument(*square);
                }
                polynomials(row, &series);
            } else {
                self.evaluate(row, &mut slopes);
                for correlation in row.iter_mut() {
                    *correlation -= 1.0;
                }
            }
        }
        above
    }

    /// Returns the variable of the [series](Self::series) at a squared distance.
    fn argument(self, square: f64) -> f64 {
        match self {
            Self::Matern52 => (5.0 * square).sqrt(),
            Self::Matern32 => (3.0 * square).sqrt(),
            Self::SquaredExponential => 0.5 * square,
        }
    }

    /// Returns the Taylor coefficients of the correlation minus 1, enough of them for arguments below 1.
    fn series(self) -> [f64; 22] {
        let mut factorial = 1.0;
        std::array::from_fn(|n| {
            let k = n as f64;
            factorial *= k.max(1.0);
            let alternating = if n % 2 == 0 { 1.0 / factorial } else { -1.0 / factorial };
            match self {
                _ if n == 0 => 0.0,
                Self::Matern52 => alternating * (k - 1.0) * (k - 3.0) / 3.0,
                Self::Matern32 => alternating * (1.0 - k),
                Self::SquaredExponential => alternating,
            }
        })
    }

    /// Returns the derivatives of the correlations of one point with others (one per column) with respect to the
    /// point's coordinates (`coordinates x others`), all in length scales.
    pub fn gradient(self, point: &[f64], others: &Matrix) -> Matrix {
        let mut squares = vec![0.0; others.columns()];
        let mut slopes = squares.clone();
        squared_distances(point, others, &mut squares);
        self.evaluate(&mut squares, &mut slopes);
        Matrix::from_fn(point.len(), others.columns(), |k, j| {
            slopes[j] * (others[(k, j)] - point[k])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Kernel; 3] = [Kernel::Matern52, Kernel::Matern32, Kernel::SquaredExponential];

    /// Source: Rasmussen and Williams (2006), equations 4.9 and 4.17.
    fn closed_form(kernel: Kernel, r: f64) -> f64 {
        match kernel {
            Kernel::Matern52 => {
                (1.0 + 5.0_f64.sqrt() * r + 5.0 * r * r / 3.0) * (-(5.0_f64.sqrt()) * r).exp()
            }
            Kernel::Matern32 => (1.0 + 3.0_f64.sqrt() * r) * (-(3.0_f64.sqrt()) * r).exp(),
            Kernel::SquaredExponential => (-0.5 * r * r).exp(),
        }
    }

    #[test]
    fn correlations_have_their_closed_forms() {
        let others = Matrix::from_fn(1, 90, |_, j| 0.1 * j as f64);
        let origin = Matrix::zeros(1, 1);
        for kernel in ALL {
            let found = kernel.between(&origin, &others);
            let gradient = kernel.gradient(&[0.0], &others);
            for j in 0..90 {
                let r = others[(0, j)];
                let expected = closed_form(kernel, r);
                assert!((found[(0, j)] - expected).abs() < 1e-15);
                // A larger coordinate of the point makes the distance smaller.
                let difference =
                    (closed_form(kernel, r - 1e-6) - closed_form(kernel, r + 1e-6)) / 2e-6;
                assert!(j == 0 || (gradient[(0, j)] - difference).abs() < 1e-9);
            }
        }
    }

    /// Compares with the closed form; for near points, where its difference from 1 keeps few digits, with the first
    /// terms of the series.
    #[test]
    fn what_is_above_one_keeps_its_digits() {
        for kernel in ALL {
            for (far, step) in [(0.3, 0.3), (40.0, 0.05)] {
                let others = Matrix::from_fn(1, 30, |_, j| (far * 0.04 + step * j as f64) / 30.0);
                let found = kernel.above_one(&Matrix::zeros(1, 1), &others);
                for j in 0..30 {
                    let expected = closed_form(kernel, others[(0, j)]) - 1.0;
                    assert!((found[(0, j)] - expected).abs() < 4e-16);
                }
            }
        }
        // -5/6 r^2 + 25/24 r^4 - ... at r = 1e-6.
        let near = Matrix::from_vec(1, 1, vec![1e-6]);
        let found = Kernel::Matern52.above_one(&Matrix::zeros(1, 1), &near)[(0, 0)];
        assert!((found + 5.0 / 6.0 * 1e-12).abs() < 1e-23, "{found:e}");
    }

    #[test]
    fn correlations_among_points_are_those_between_them() {
        let points = Matrix::from_fn(3, 20, |k, j| ((5 * k + 3 * j) as f64).sin());
        for kernel in ALL {
            let (among, between) = (kernel.among(&points, 0.1).0, kernel.between(&points, &points));
            for i in 0..20 {
                assert_eq!(among.row(i)[..i], between.row(i)[..i]);
                assert_eq!(among[(i, i)], 1.1);
            }
        }
    }
}
