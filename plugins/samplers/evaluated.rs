//! Points with their prior density and their likelihood, for methods that treat the two differently.

use lacuna::linalg::{Cholesky, Matrix};
use lacuna::plugin::Target;
use lacuna::plugin::sampler::State;
use lacuna::run::Stop;

/// Points with their log densities.
pub(super) struct Evaluated {
    /// The points, one a row.
    pub points: Matrix,
    /// The log prior density of each.
    pub log_prior: Vec<f64>,
    /// The log density of each, prior times likelihood; minus infinity outside the support.
    pub log_density: Vec<f64>,
    /// How many points lay in the prior's support, so that the likelihood was asked for.
    pub evaluations: u64,
}

impl Evaluated {
    /// Evaluates points; outside the prior's support the likelihood costs nothing.
    pub fn new(target: &dyn Target, points: Matrix) -> Self {
        let log_prior = target.log_prior(&points);
        let inside: Vec<usize> =
            (0..points.rows()).filter(|&i| log_prior[i] > f64::NEG_INFINITY).collect();
        let mut log_density = vec![f64::NEG_INFINITY; points.rows()];
        if !inside.is_empty() {
            let found = target.log_density(&points.select_rows(&inside));
            for (&i, value) in inside.iter().zip(found) {
                // A density without a value is no density.
                log_density[i] = if value < f64::INFINITY { value } else { f64::NEG_INFINITY };
            }
        }
        Self { points, log_prior, log_density, evaluations: inside.len() as u64 }
    }

    /// The points of a state, which loses them.
    pub fn take(target: &dyn Target, state: &mut State) -> Self {
        let points = std::mem::take(&mut state.points);
        let log_density = std::mem::take(&mut state.log_density);
        let log_prior = target.log_prior(&points);
        Self { points, log_prior, log_density, evaluations: 0 }
    }

    /// The log-likelihood of one point; minus infinity outside the support.
    pub fn log_likelihood(&self, i: usize) -> f64 {
        if self.log_density[i] > f64::NEG_INFINITY {
            self.log_density[i] - self.log_prior[i]
        } else {
            f64::NEG_INFINITY
        }
    }

    /// The log-likelihood of each point.
    pub fn log_likelihoods(&self) -> Vec<f64> {
        (0..self.log_density.len()).map(|i| self.log_likelihood(i)).collect()
    }

    /// Puts point `from` of `other` in the place of point `to`.
    pub fn replace(&mut self, to: usize, other: &Self, from: usize) {
        self.points.row_mut(to).copy_from_slice(other.points.row(from));
        self.log_prior[to] = other.log_prior[from];
        self.log_density[to] = other.log_density[from];
    }

    /// The points at these places, in this order.
    pub fn select(&self, places: &[usize]) -> Self {
        Self {
            points: self.points.select_rows(places),
            log_prior: places.iter().map(|&i| self.log_prior[i]).collect(),
            log_density: places.iter().map(|&i| self.log_density[i]).collect(),
            evaluations: 0,
        }
    }
}

/// Centre and factored covariance of weighted points.
pub(super) struct Shape {
    pub centre: Vec<f64>,
    pub factor: Cholesky,
}

impl Shape {
    /// The shape of points with these weights, which sum to one.
    ///
    /// Where the points span no volume, a small share of the variances is added to them.
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
