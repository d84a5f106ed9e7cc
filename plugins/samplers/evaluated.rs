//! Points with prior density and likelihood kept apart, for samplers that treat the two differently.

use lacuna::plugin::Target;
use lacuna::plugin::sampler::State;
use lacuna::run::Stop;
use lacuna_linalg::{Cholesky, Matrix};

/// Points with their log densities, one row per point.
pub(super) struct Evaluated {
    /// The points, one per row.
    pub points: Matrix,
    /// Log prior density of each point.
    pub log_prior: Vec<f64>,
    /// Log density of each point, prior times likelihood; minus infinity outside the support.
    pub log_density: Vec<f64>,
    /// Number of points inside the prior's support, i.e. of evaluations of the likelihood.
    pub evaluations: u64,
}

impl Evaluated {
    /// Evaluates points, one per row. Points outside the prior's support are not passed to the likelihood.
    pub fn new(target: &dyn Target, points: Matrix) -> Self {
        let log_prior = target.log_prior(&points);
        let inside: Vec<usize> =
            (0..points.rows()).filter(|&i| log_prior[i] > f64::NEG_INFINITY).collect();
        let mut log_density = vec![f64::NEG_INFINITY; points.rows()];
        if !inside.is_empty() {
            let found = target.log_density(&points.select_rows(&inside));
            for (&i, value) in inside.iter().zip(found) {
                // NaN and plus infinity count as zero density.
                log_density[i] = if value < f64::INFINITY { value } else { f64::NEG_INFINITY };
            }
        }
        Self { points, log_prior, log_density, evaluations: inside.len() as u64 }
    }

    /// Takes the points out of a state, which is left empty.
    pub fn take(target: &dyn Target, state: &mut State) -> Self {
        let points = std::mem::take(&mut state.points);
        let log_density = std::mem::take(&mut state.log_density);
        let log_prior = target.log_prior(&points);
        Self { points, log_prior, log_density, evaluations: 0 }
    }

    /// Returns the log-likelihood of point `i`; minus infinity outside the support.
    pub fn log_likelihood(&self, i: usize) -> f64 {
        if self.log_density[i] > f64::NEG_INFINITY {
            self.log_density[i] - self.log_prior[i]
        } else {
            f64::NEG_INFINITY
        }
    }

    /// Returns the log-likelihood of each point.
    pub fn log_likelihoods(&self) -> Vec<f64> {
        (0..self.log_density.len()).map(|i| self.log_likelihood(i)).collect()
    }

    /// Replaces point `to` by point `from` of `other`.
    pub fn replace(&mut self, to: usize, other: &Self, from: usize) {
        self.points.row_mut(to).copy_from_slice(other.points.row(from));
        self.log_prior[to] = other.log_prior[from];
        self.log_density[to] = other.log_density[from];
    }

    /// Returns the points with these indices, in this order.
    pub fn select(&self, places: &[usize]) -> Self {
        Self {
            points: self.points.select_rows(places),
            log_prior: places.iter().map(|&i| self.log_prior[i]).collect(),
            log_density: places.iter().map(|&i| self.log_density[i]).collect(),
            evaluations: 0,
        }
    }
}

/// Mean and factored covariance of weighted points.
pub(super) struct Shape {
    pub centre: Vec<f64>,
    pub factor: Cholesky,
}

impl Shape {
    /// Computes the mean and the covariance of points with these weights, which must sum to 1.
    ///
    /// If the covariance is singular, its variances are increased by a factor of up to 1.001; fails if that is not
    /// enough.
    pub fn of(points: &Matrix, weights: &[f64]) -> Result<Self, Stop> {
        let d = points.columns();
        let mut centre = vec![0.0; d];
        for (point, w) in points.iter_rows().zip(weights) {
            centre.iter_mut().zip(point).for_each(|(c, x)| *c += w * x);
        }
        let mut covariance = Matrix::zeros(d, d);
        for (point, w) in points.iter_rows().zip(weights) {
            for i in 0..d {
                for j in 0..=i {
                    covariance[(i, j)] += w * (point[i] - centre[i]) * (point[j] - centre[j]);
                }
            }
        }
        for share in [0.0, 1e-10, 1e-6, 1e-3] {
            let mut widened = covariance.clone();
            (0..d).for_each(|i| widened[(i, i)] *= 1.0 + share);
            if let Ok(factor) = Cholesky::new(&widened) {
                return Ok(Self { centre, factor });
            }
        }
        Err(Stop::new(format!(
            "the {} points of the population do not span the space of {d} unknowns",
            points.rows()
        ))
        .help("more particles, or priors without constant unknowns"))
    }
}
