//! Starting points of chains for a posterior with populations.

use lacuna::math::random::Stream;
use lacuna::plugin::Target;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use crate::posterior::Posterior;

/// Largest distance of a scale from that of the maximum, as a logarithm. The density of centred members grows without limit
/// towards a scale of zero, from where no chain returns.
const REACH: f64 = 1.0;

/// A posterior of standardised members whose scales are kept near those of a point.
struct Near<'a> {
    posterior: &'a Posterior<'a>,
    scales: Vec<usize>,
    bounds: Vec<(f64, f64)>,
}

impl Target for Near<'_> {
    fn dimension(&self) -> usize {
        self.posterior.dimension()
    }
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        self.posterior.log_density(points)
    }
    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        self.posterior.log_prior(points)
    }
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        self.posterior.gradient(point)
    }
    fn bounds(&self) -> Vec<(f64, f64)> {
        self.bounds.clone()
    }
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut draws = self.posterior.prior_draws(count, stream);
        for i in 0..draws.rows() {
            for &j in &self.scales {
                draws[(i, j)] = draws[(i, j)].clamp(self.bounds[j].0, self.bounds[j].1);
            }
        }
        draws
    }
    fn failure(&self) -> Option<String> {
        self.posterior.failure()
    }
}

/// Starting points in the coordinates of a posterior, made by `make` around a point of these coordinates: in those of
/// standardised members, on which the density depends smoothly, with scales near those of the point.
pub(super) fn around(
    posterior: &Posterior<'_>,
    best: &[f64],
    make: impl FnOnce(&dyn Target, &[f64]) -> Result<Matrix, Stop>,
) -> Result<Matrix, Stop> {
    let standardised = posterior.standardised();
    let best = standardised.coordinates(&posterior.natural(best));
    let scales: Vec<usize> =
        posterior.populations().iter().map(|population| population.scale).collect();
    let mut bounds = standardised.bounds();
    for &j in &scales {
        let (low, high) = bounds[j];
        bounds[j] = ((best[j] - REACH).max(low), (best[j] + REACH).min(high));
    }
    let near = Near { posterior: &standardised, scales, bounds };
    let points = make(&near, &best)?;
    let back = |point: &[f64]| posterior.coordinates(&standardised.natural(point));
    Ok(Matrix::from_rows(best.len(), points.iter_rows().map(back)))
}
