//! Starting points around maxima in corners, for distributions with known quantiles.

use lacuna_base::math::distribution::Distribution;
use lacuna_base::math::moments::{quantile, sorted};
use lacuna_base::math::random::uniform;

use crate::*;

const FREE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// A normal distribution with unit variances and equal correlations, truncated to positive values in the first
/// coordinates; its mean is negative there, so that the mode is a corner.
struct Corner {
    means: Vec<f64>,
    active: usize,
    precision: Matrix,
    upper: f64,
}

impl Corner {
    fn new(dimension: usize, active: usize, scale: f64, upper: f64) -> Self {
        let means = (0..dimension)
            .map(|j| if j < active { -scale * (0.5 + j as f64) } else { 0.3 * j as f64 })
            .collect();
        // Diagonal dominance keeps the mode in the corner.
        let precision =
            Matrix::from_fn(dimension, dimension, |i, j| if i == j { 1.0 } else { 0.02 });
        Self { means, active, precision, upper }
    }

    fn slope(&self, x: &[f64]) -> Vec<f64> {
        let e: Vec<f64> = x.iter().zip(&self.means).map(|(x, m)| x - m).collect();
        lacuna_linalg::multiply_vector(&self.precision, &e).iter().map(|p| -p).collect()
    }
}

impl Target for Corner {
    fn dimension(&self) -> usize {
        self.means.len()
    }
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        let density = |x: &[f64]| {
            let outside =
                x.iter().zip(self.bounds()).any(|(x, (lo, hi))| *x < lo || *x > hi || x.is_nan());
            let e = x.iter().zip(&self.means).map(|(x, m)| x - m);
            let half: f64 = self.slope(x).iter().zip(e).map(|(p, e)| 0.5 * p * e).sum();
            if outside { f64::NEG_INFINITY } else { half }
        };
        points.iter_rows().map(density).collect()
    }
    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        vec![0.0; points.rows()]
    }
    fn gradient(&self, x: &[f64]) -> (f64, Vec<f64>) {
        (self.log_density(&Matrix::from_rows(x.len(), [x]))[0], self.slope(x))
    }
    fn bounds(&self) -> Vec<(f64, f64)> {
        let law = |j| if j < self.active { (0.0, self.upper) } else { FREE };
        (0..self.means.len()).map(law).collect()
    }
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        Matrix::from_fn(count, self.means.len(), |_, _| 3.0 * uniform(&mut rng))
    }
}

/// Quantile of a normal variable with mean `-m` and variance one truncated to positive values, in closed form.
fn truncated_quantile(m: f64, p: f64) -> f64 {
    Distribution::TruncatedNormal([-m, 1.0, 0.0, f64::INFINITY]).quantile(p)
}

#[test]
fn corners_of_any_number_of_bounds_have_starting_points_that_cover_the_law() {
    for active in 1..=10 {
        for (scale, upper) in [(1.0, f64::INFINITY), (20.0, f64::INFINITY), (1.0, 50.0)] {
            let target = Corner::new(12, active, scale, upper);
            let start = Matrix::from_rows(12, [vec![1.0; 12]]);
            let top = maximise(&target, &start).remove(0);
            let shape = laplace(&target, &top.point).unwrap();
            let stream = Stream::root(active as u64);
            let points = scatter(&target, &top.point, &shape, 400, &stream).unwrap();
            let values = target.log_density(&points);
            assert!(values.iter().all(|l| l.is_finite()), "{active} {scale}");
            for j in (0..active).filter(|_| active > 1) {
                let column = sorted(&points.column(j));
                let found = |p| quantile(&column, p);
                // Couplings of 0.02 to other coordinates shift the mean slightly; the factors allow for that.
                let m = -target.means[j];
                let exact = |p| truncated_quantile(m, p);
                assert!(found(0.1) < 2.5 * exact(0.1), "{active} {scale} {j}: {}", found(0.1));
                assert!(found(0.9) > 0.8 * exact(0.9), "{active} {scale} {j}: {}", found(0.9));
                assert!(found(0.5) < 3.0 * exact(0.5) && found(0.5) > exact(0.5) / 3.0, "{j}");
            }
        }
    }
}

/// Independent distributions with a likelihood that depends on all of them, so that none is taken for its prior.
struct Laws(Vec<Distribution>);

impl Target for Laws {
    fn dimension(&self) -> usize {
        self.0.len()
    }
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        let density = |x: &[f64]| self.0.iter().zip(x).map(|(law, x)| law.log_density(*x)).sum();
        points.iter_rows().map(density).collect()
    }
    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        vec![0.0; points.rows()]
    }
    fn gradient(&self, x: &[f64]) -> (f64, Vec<f64>) {
        let slopes = self.0.iter().zip(x).map(|(law, x)| law.log_density_derivative(*x));
        (self.log_density(&Matrix::from_rows(x.len(), [x]))[0], slopes.collect())
    }
    fn bounds(&self) -> Vec<(f64, f64)> {
        self.0.iter().map(Distribution::support).collect()
    }
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        Matrix::from_fn(count, self.0.len(), |_, j| self.0[j].sample(&mut rng))
    }
}

#[test]
fn corners_of_log_uniform_and_half_bounded_laws_have_starting_points() {
    let target = Laws(vec![
        Distribution::LogUniform([1e-6, 1e3]),
        Distribution::HalfNormal(1e5),
        Distribution::Exponential(1e-8),
        Distribution::Beta([1.0, 3.0, 0.0, 1.0]),
        Distribution::TruncatedNormal([-3.0, 1.0, 0.0, f64::INFINITY]),
    ]);
    let top = [1e-6, 0.0, 0.0, 0.0, 0.0];
    let points = scatter_without_bounds(&target, &top, 300, &Stream::root(5)).unwrap();
    for (j, law) in target.0.iter().enumerate() {
        let column = sorted(&points.column(j));
        let found = |p| quantile(&column, p);
        let (low, high) = law.support();
        assert!(found(0.0) > low && found(1.0) < high, "{law}");
        let middle = [0.05, 0.5, 0.95].map(found);
        assert!(middle[0] < law.quantile(0.4) && middle[2] > law.quantile(0.6), "{law} {middle:?}");
    }
}
