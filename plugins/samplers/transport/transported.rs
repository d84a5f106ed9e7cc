//! A density in the coordinates of a map.

use lacuna::math::random::Stream;
use lacuna::math::transform::Unconstrained;
use lacuna::plugin::Target;
use lacuna_linalg::Matrix;

use super::map::Map;

/// A target in free coordinates, or in those of a map of them.
pub(super) struct Transported<'a> {
    target: &'a dyn Target,
    free: Unconstrained<'a>,
    map: Option<&'a Map>,
}

impl<'a> Transported<'a> {
    pub fn new(target: &'a dyn Target, map: Option<&'a Map>) -> Self {
        Self { target, free: Unconstrained::new(target), map }
    }

    /// The free point of a transported one.
    pub fn free(&self, z: &[f64]) -> Vec<f64> {
        self.map.map_or_else(|| z.to_vec(), |map| map.free(z).0)
    }

    /// Points of the target.
    pub fn points(&self, z: &Matrix) -> Matrix {
        Matrix::from_rows(z.columns(), z.iter_rows().map(|z| self.free.bounded(&self.free(z))))
    }
}

impl Target for Transported<'_> {
    fn dimension(&self) -> usize {
        self.free.dimension()
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        let Some(map) = self.map else { return self.free.log_density(points) };
        let (places, determinants): (Vec<_>, Vec<_>) =
            points.iter_rows().map(|z| map.free(z)).unzip();
        let density = self.free.log_density(&Matrix::from_rows(points.columns(), places));
        let sum = density.iter().zip(determinants).map(|(density, log)| density + log);
        sum.map(|value| if value.is_finite() { value } else { f64::NEG_INFINITY }).collect()
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        let places = points.iter_rows().map(|z| self.free(z));
        self.free.log_prior(&Matrix::from_rows(points.columns(), places))
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let Some(map) = self.map else { return self.free.gradient(point) };
        let (free, log) = map.free(point);
        if !free.iter().all(|u| u.is_finite()) {
            return (f64::NEG_INFINITY, vec![0.0; point.len()]);
        }
        let (value, gradient) = self.free.gradient(&free);
        let gradient = map.pulled(point, &gradient);
        if (value + log).is_finite() && gradient.iter().all(|g| g.is_finite()) {
            (value + log, gradient)
        } else {
            (f64::NEG_INFINITY, vec![0.0; point.len()])
        }
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        vec![(f64::NEG_INFINITY, f64::INFINITY); self.dimension()]
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let draws = self.free.prior_draws(count, stream);
        match self.map {
            Some(map) => {
                Matrix::from_rows(draws.columns(), draws.iter_rows().map(|u| map.transported(u)))
            }
            None => draws,
        }
    }

    fn failure(&self) -> Option<String> {
        self.target.failure()
    }
}
