//! Distance of a point from the runs, expressed as the kriging variance of a process conditioned on them.

use lacuna_linalg::vector::dot;
use lacuna_linalg::{
    Cholesky, Matrix, multiply, multiply_transposed, multiply_vector, transposed_multiply,
};

/// Variance of a run about the process, which keeps the system solvable.
const NUGGET: f64 = 1e-4;

/// Kriging variance of a process of unit variance with a linear trend (universal kriging: Rasmussen and Williams,
/// Gaussian Processes for Machine Learning (2006), section 2.7). It grows with the distance from the runs and, where
/// the trend is extrapolated, like the leverage of a regression.
#[derive(Debug, Clone, PartialEq)]
pub struct Kriging {
    /// Runs in units of the length scale, one per row.
    places: Matrix,
    /// Inverse of the covariance bordered by the trend.
    inverse: Matrix,
    length: f64,
}

impl Kriging {
    /// Conditions on runs at these positions, one per row; `None` if they are too few or coincide.
    pub fn new(places: &Matrix, length: f64) -> Option<Self> {
        let (n, d) = (places.rows(), places.columns());
        if n < d + 4 {
            return None;
        }
        let scaled = Matrix::from_fn(n, d, |i, k| places[(i, k)] / length);
        let covariance = Matrix::from_fn(n, n, |i, j| {
            let nugget = if i == j { NUGGET } else { 0.0 };
            correlation(distance(scaled.row(i), scaled.row(j))) + nugget
        });
        let factor = Cholesky::new(&covariance).ok()?;
        let trend = Matrix::from_fn(n, d + 1, |i, k| if k == 0 { 1.0 } else { scaled[(i, k - 1)] });
        let solved = factor.solve_matrix(&trend);
        let inner = Cholesky::new(&transposed_multiply(&trend, &solved)).ok()?.inverse();
        // [[K, F], [F', 0]]^-1 by blocks.
        let cross = multiply(&solved, &inner);
        let through = multiply_transposed(&cross, &solved);
        let plain = factor.inverse();
        let inverse = Matrix::from_fn(n + d + 1, n + d + 1, |i, j| match (i < n, j < n) {
            (true, true) => plain[(i, j)] - through[(i, j)],
            (true, false) => cross[(i, j - n)],
            (false, true) => cross[(j, i - n)],
            (false, false) => -inner[(i - n, j - n)],
        });
        Some(Self { places: scaled, inverse, length })
    }

    /// Kriging variance at a position.
    pub fn variance(&self, place: &[f64]) -> f64 {
        let place: Vec<f64> = place.iter().map(|x| x / self.length).collect();
        let runs = self.places.iter_rows().map(|run| correlation(distance(run, &place)));
        let border: Vec<f64> = runs.chain([1.0]).chain(place.iter().copied()).collect();
        (1.0 + NUGGET - dot(&border, &multiply_vector(&self.inverse, &border))).max(NUGGET)
    }

    /// Kriging variance at each run given the other runs (Dubrule, Mathematical Geology 15 (1983) 687).
    pub fn left_out(&self) -> Vec<f64> {
        let one = |i: usize| (1.0 / self.inverse[(i, i)].max(1e-12)).max(NUGGET);
        (0..self.places.rows()).map(one).collect()
    }
}

/// Matérn correlation of smoothness 5/2 at a distance in length scales.
fn correlation(distance: f64) -> f64 {
    let r = 5.0_f64.sqrt() * distance;
    (1.0 + r + r * r / 3.0) * (-r).exp()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt()
}
