//! Densities on which samplers are tested.

use std::f64::consts::PI;

use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::matrix::Matrix;
use lacuna::plugin::Target;

/// A normal distribution in two correlated coordinates of different scale, under a prior that is three times as wide
/// and one standard deviation away.
pub(super) struct Normal;

/// Means of the normal distribution.
pub(super) const MEAN: [f64; 2] = [1.0, -200.0];
/// Standard deviations of the normal distribution.
pub(super) const SD: [f64; 2] = [0.5, 30.0];
const CORRELATION: f64 = 0.6;

impl Normal {
    fn priors() -> [Distribution; 2] {
        [0, 1].map(|j| Distribution::Normal([MEAN[j] + SD[j], 3.0 * SD[j]]))
    }

    /// Log of the integral of the density, which is one at its maximum.
    pub(super) fn log_evidence() -> f64 {
        (2.0 * PI * SD[0] * SD[1]).ln() + 0.5 * (1.0 - CORRELATION * CORRELATION).ln()
    }
}

impl Target for Normal {
    fn dimension(&self) -> usize {
        2
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|point| self.gradient(point).0).collect()
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        log_prior(&Self::priors(), points)
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let (u, v) = ((point[0] - MEAN[0]) / SD[0], (point[1] - MEAN[1]) / SD[1]);
        let rest = 1.0 - CORRELATION * CORRELATION;
        let slope = [(u - CORRELATION * v) / rest, (v - CORRELATION * u) / rest];
        (-0.5 * (u * slope[0] + v * slope[1]), vec![-slope[0] / SD[0], -slope[1] / SD[1]])
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        vec![(f64::NEG_INFINITY, f64::INFINITY); 2]
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        prior_draws(&Self::priors(), count, stream)
    }
}

/// An exponential distribution of mean one beside a uniform one, with zero density outside `[0, inf) x [0, 1]`; the
/// prior of the first coordinate has mean two. The density integrates to one.
pub(super) struct Bounded;

impl Bounded {
    const PRIORS: [Distribution; 2] =
        [Distribution::Exponential(2.0), Distribution::Uniform([0.0, 1.0])];

    /// Returns true if a point lies in the support.
    pub(super) fn holds(point: &[f64]) -> bool {
        point[0] >= 0.0 && point[0].is_finite() && (0.0..=1.0).contains(&point[1])
    }
}

impl Target for Bounded {
    fn dimension(&self) -> usize {
        2
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|point| self.gradient(point).0).collect()
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        log_prior(&Self::PRIORS, points)
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        if Self::holds(point) {
            (-point[0], vec![-1.0, 0.0])
        } else {
            (f64::NEG_INFINITY, vec![0.0, 0.0])
        }
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        vec![(0.0, f64::INFINITY), (0.0, 1.0)]
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        prior_draws(&Self::PRIORS, count, stream)
    }
}

fn log_prior(laws: &[Distribution; 2], points: &Matrix) -> Vec<f64> {
    let density = |point: &[f64]| laws.iter().zip(point).map(|(law, &x)| law.log_density(x)).sum();
    points.iter_rows().map(density).collect()
}

fn prior_draws(laws: &[Distribution; 2], count: usize, stream: &Stream) -> Matrix {
    let mut rng = stream.generator();
    Matrix::from_fn(count, 2, |_, j| laws[j].sample(&mut rng))
}
