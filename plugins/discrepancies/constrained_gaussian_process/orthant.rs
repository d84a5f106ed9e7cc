//! Probability that a normal vector has no negative component.
//!
//! The separation of variables of Genz (J. Computational and Graphical Statistics 1 (1992) 141): with `c = m + L y` the
//! components of `y` are drawn one after the other from normal distributions truncated so that `c >= 0`, and the
//! probability is the mean of the products of their normalising constants. The points are those of a fixed lattice
//! (square roots of primes, folded), so that the estimate is a smooth function of mean and covariance, with exact
//! derivatives: by the chain rule backwards through the recursion, and through the Cholesky factor (Murray,
//! Differentiation of the Cholesky decomposition, arXiv:1602.07527 (2016)).

use lacuna::math::moments::log_sum;
use lacuna::math::special::{ln_normal_cdf, normal_cdf, normal_quantile, normal_quantile_of_ln};
use lacuna_linalg::vector::{add_scaled, dot};
use lacuna_linalg::{Cholesky, Matrix, multiply, solve_lower_transposed, transposed_multiply};

/// Number of points of the lattice.
const POINTS: usize = 200;

/// Derivatives of the logarithm of the probability.
pub(super) struct Orthant {
    /// Derivatives with respect to the mean.
    pub by_mean: Vec<f64>,
    /// Symmetric derivative with respect to the covariance: a small symmetric change `D` changes the logarithm by the
    /// sum of the products of the entries.
    pub by_covariance: Matrix,
}

/// Points of the recursion: weights and components.
pub(super) struct Points {
    /// Logarithms of the weights.
    pub log_weights: Vec<f64>,
    /// Components of `c`, `points x size`.
    pub values: Matrix,
}

/// One point of the recursion.
struct Path {
    /// Standardised components `y`, and the bounds `t` below which they may not lie.
    drawn: Vec<f64>,
    bound: Vec<f64>,
    log_weight: f64,
}

/// Returns the logarithm of the probability; `None` if the covariance is not positive definite.
pub(super) fn log_probability(mean: &[f64], covariance: &Matrix) -> Option<f64> {
    let cholesky = Cholesky::new(covariance).ok()?;
    let lattice = Lattice::new(mean.len());
    let logs: Vec<f64> = (0..POINTS)
        .map(|i| path(mean, cholesky.lower(), |k| lattice.at(i, k)).log_weight)
        .collect();
    Some(log_sum(logs.iter().copied()) - (POINTS as f64).ln())
}

/// Returns the derivatives of [`log_probability`]; `None` if the covariance is not positive definite.
pub(super) fn gradient(mean: &[f64], covariance: &Matrix) -> Option<Orthant> {
    let cholesky = Cholesky::new(covariance).ok()?;
    let (lower, size) = (cholesky.lower(), mean.len());
    let lattice = Lattice::new(size);
    let paths: Vec<Path> = (0..POINTS).map(|i| path(mean, lower, |k| lattice.at(i, k))).collect();
    let total = log_sum(paths.iter().map(|path| path.log_weight));
    let mut by_mean = vec![0.0; size];
    let mut by_lower = Matrix::zeros(size, size);
    for (i, path) in paths.iter().enumerate() {
        let weight = (path.log_weight - total).exp();
        let rest = |k: usize| 1.0 - lattice.at(i, k);
        backwards(path, lower, weight, rest, &mut by_mean, &mut by_lower);
    }
    Some(Orthant { by_mean, by_covariance: by_covariance(lower, &by_lower) })
}

/// Returns weighted points of the truncated distribution, on the fixed lattice.
pub(super) fn points(mean: &[f64], cholesky: &Cholesky) -> Points {
    let lattice = Lattice::new(mean.len());
    collected(mean, cholesky, POINTS, |i, k| lattice.at(i, k))
}

/// Returns weighted points of the truncated distribution, one for each row of uniform numbers.
pub(super) fn random_points(mean: &[f64], cholesky: &Cholesky, uniform: &Matrix) -> Points {
    collected(mean, cholesky, uniform.rows(), |i, k| uniform[(i, k)])
}

fn collected(
    mean: &[f64],
    cholesky: &Cholesky,
    count: usize,
    uniform: impl Fn(usize, usize) -> f64,
) -> Points {
    let mut points =
        Points { log_weights: Vec::with_capacity(count), values: Matrix::zeros(count, mean.len()) };
    for i in 0..count {
        let path = path(mean, cholesky.lower(), |k| uniform(i, k));
        let colour = cholesky.colour(&path.drawn);
        let values = points.values.row_mut(i).iter_mut().zip(mean.iter().zip(colour));
        values.for_each(|(value, (m, c))| *value = m + c);
        points.log_weights.push(path.log_weight);
    }
    points
}

/// Runs the recursion; `uniform(k)` is the uniform number of component `k`.
fn path(mean: &[f64], lower: &Matrix, uniform: impl Fn(usize) -> f64) -> Path {
    let size = mean.len();
    let (mut drawn, mut bound) = (vec![0.0; size], vec![0.0; size]);
    // Logarithms are taken once, of the product, unless it leaves the range of numbers.
    let (mut weight, mut log_weight) = (1.0, 0.0);
    for k in 0..size {
        let row = lower.row(k);
        let t = -(mean[k] + dot(&row[..k], &drawn[..k])) / row[k];
        let above = normal_cdf(-t);
        bound[k] = t;
        if above > 1e-150 && weight > 1e-150 {
            weight *= above;
            drawn[k] = -normal_quantile(above * (1.0 - uniform(k)));
        } else {
            let log_above = ln_normal_cdf(-t);
            log_weight += log_above;
            drawn[k] = -normal_quantile_of_ln(log_above + (-uniform(k)).ln_1p());
        }
    }
    Path { drawn, bound, log_weight: log_weight + weight.ln() }
}

/// Adds the derivatives of one point's log weight, times its share `weight`. `rest(k)` is one minus the uniform number.
fn backwards(
    path: &Path,
    lower: &Matrix,
    weight: f64,
    rest: impl Fn(usize) -> f64,
    by_mean: &mut [f64],
    by_lower: &mut Matrix,
) {
    let size = by_mean.len();
    let mut by_drawn = vec![0.0; size];
    for k in (0..size).rev() {
        let (t, y, row) = (path.bound[k], path.drawn[k], lower.row(k));
        let hazard = (-0.5 * t * t - HALF_LN_TWO_PI - ln_normal_cdf(-t)).exp();
        let moved = rest(k) * (0.5 * (y - t) * (y + t)).exp();
        let by_bound = -weight * hazard + by_drawn[k] * moved;
        let by_sum = -by_bound / row[k];
        by_mean[k] += by_sum;
        add_scaled(&mut by_drawn[..k], by_sum, &row[..k]);
        let own = by_lower.row_mut(k);
        add_scaled(&mut own[..k], by_sum, &path.drawn[..k]);
        own[k] += by_sum * t;
    }
}

const HALF_LN_TWO_PI: f64 = 0.918_938_533_204_672_8;

/// Returns the symmetric derivative with respect to `L L'`, given that with respect to `L`: `L'^-1 (P + P') L^-1 / 2`
/// with `P` the lower triangle of `L' dL`, its diagonal halved.
fn by_covariance(lower: &Matrix, by_lower: &Matrix) -> Matrix {
    let size = lower.rows();
    let product = transposed_multiply(lower, by_lower);
    let mut both = Matrix::from_fn(size, size, |i, j| 0.5 * product[(i.max(j), i.min(j))]);
    // L'^-1 from the left, column by column; the matrix is symmetric, so that its rows serve.
    for _ in 0..2 {
        for i in 0..size {
            solve_lower_transposed(lower, both.row_mut(i));
        }
        both = both.transposed();
    }
    both
}

/// Points of the unit cube: multiples of the square roots of primes, folded.
struct Lattice {
    roots: Vec<f64>,
}

impl Lattice {
    fn new(size: usize) -> Self {
        let is_prime = |n: &u32| (2..*n).take_while(|d| d * d <= *n).all(|d| !n.is_multiple_of(d));
        let primes = (2_u32..).filter(is_prime).take(size);
        Self { roots: primes.map(|p| f64::from(p).sqrt()).collect() }
    }

    /// Returns component `k` of a point.
    fn at(&self, point: usize, k: usize) -> f64 {
        (2.0 * ((point + 1) as f64 * self.roots[k]).fract() - 1.0).abs().min(1.0 - 1e-12)
    }
}

/// Returns the second moments of weighted points about zero after a linear map of their deviations from a mean: the mean
/// of `(b + B (c - m))²` for each row of `B`, with `b` the offsets.
pub(super) fn mean_squares(
    points: &Points,
    mean: &[f64],
    map: &Matrix,
    offset: &[f64],
) -> Vec<f64> {
    let total = log_sum(points.log_weights.iter().copied());
    let deviations =
        Matrix::from_fn(points.values.rows(), mean.len(), |i, k| points.values[(i, k)] - mean[k]);
    let mapped = multiply(&deviations, &map.transposed());
    let mut squares = vec![0.0; offset.len()];
    for (row, log_weight) in mapped.iter_rows().zip(&points.log_weights) {
        let weight = (log_weight - total).exp();
        for ((sum, x), b) in squares.iter_mut().zip(row).zip(offset) {
            *sum += weight * (x + b).powi(2);
        }
    }
    squares
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Equal correlations of 1/2: the probability that the first of `n + 1` exchangeable variables is the smallest,
    /// `1 / (n + 1)`. Correlations `r` of three variables: `1/8 + sum asin r / (4 pi)` (Kendall and Stuart, The Advanced
    /// Theory of Statistics I (1977), 15.10 and 15.11).
    #[test]
    fn orthants_have_their_closed_forms() {
        for size in [1, 2, 4, 8, 16] {
            let covariance = Matrix::from_fn(size, size, |i, j| if i == j { 3.0 } else { 1.5 });
            let found = log_probability(&vec![0.0; size], &covariance).unwrap();
            let expected = -(1.0 + size as f64).ln();
            assert!((found - expected).abs() < 1e-2 * size as f64, "{size} {found} {expected}");
        }
        let r = |i: usize, j: usize| [[1.0, 0.9, 0.5], [0.9, 1.0, 0.7], [0.5, 0.7, 1.0]][i][j];
        let found = log_probability(&[0.0; 3], &Matrix::from_fn(3, 3, r)).unwrap();
        let sum: f64 = [0.9_f64, 0.5, 0.7].iter().map(|r| r.asin()).sum();
        let expected = (0.125 + sum / (4.0 * std::f64::consts::PI)).ln();
        assert!((found - expected).abs() < 1e-2, "{found} {expected}");
        // A product of one-dimensional probabilities, far in the tail.
        let means = [-9.0, 2.0, -40.0];
        let unit = Matrix::from_fn(3, 3, |i, j| if i == j { 4.0 } else { 0.0 });
        let found = log_probability(&means, &unit).unwrap();
        let expected: f64 = means.iter().map(|m| ln_normal_cdf(m / 2.0)).sum();
        assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    }

    #[test]
    fn derivatives_are_those_of_the_estimate() {
        let size = 5;
        let of = |i: usize, j: usize| {
            let distance = (i as f64 - j as f64) / 2.0;
            1.3 * (-0.5 * distance * distance).exp()
                + if i == j { 0.1 + 0.1 * i as f64 } else { 0.0 }
        };
        let (mean, covariance) = ([0.3, -0.5, 0.2, 0.0, -1.0], Matrix::from_fn(size, size, of));
        let found = gradient(&mean, &covariance).unwrap();
        let h = 1e-5;
        for k in 0..size {
            let at = |d: f64| {
                let mut moved = mean;
                moved[k] += d;
                log_probability(&moved, &covariance).unwrap()
            };
            let expected = (at(h) - at(-h)) / (2.0 * h);
            assert!((found.by_mean[k] - expected).abs() < 1e-7, "{} {expected}", found.by_mean[k]);
            for j in 0..=k {
                let at = |d: f64| {
                    let mut moved = covariance.clone();
                    moved[(k, j)] += d;
                    moved[(j, k)] = moved[(k, j)];
                    log_probability(&mean, &moved).unwrap()
                };
                let expected = (at(h) - at(-h)) / (2.0 * h);
                let both = if j == k { 1.0 } else { 2.0 };
                let own = both * found.by_covariance[(k, j)];
                assert!((own - expected).abs() < 1e-7, "{k} {j}: {own} {expected}");
            }
        }
    }
}
