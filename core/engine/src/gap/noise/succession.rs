//! Autoregressive noise at the places of a grid, of which some may be missing.

use lacuna_linalg::{Cholesky, Matrix};

use super::autoregression::Autoregression;

/// An autoregression at the places of a grid that were measured.
///
/// A value that directly follows at least as many others as the order has the predictor of the autoregression itself. A
/// value after a hole is predicted from the nearest values before and behind the hole, twice the order of them, by the
/// covariances of the autoregression: this is exact if no stretch between two holes is shorter than the order, and
/// Vecchia's approximation otherwise (Journal of the Royal Statistical Society B 50 (1988) 297).
#[derive(Debug, Clone)]
pub struct Succession {
    memory: Autoregression,
    length: usize,
    /// The values after holes, in their order.
    apart: Vec<Apart>,
}

/// A value after a hole with its own predictor.
#[derive(Debug, Clone)]
struct Apart {
    at: usize,
    /// The weights of the values before it, the nearest first.
    weights: Vec<f64>,
    /// The standard deviation of the predictor's error.
    error: f64,
}

impl Succession {
    /// The autoregression at these places, which must increase.
    pub fn new(memory: &Autoregression, places: &[usize]) -> Self {
        let order = memory.order();
        let mut apart = Vec::new();
        let follows = |t: usize| {
            let before = t.min(order);
            places[t] - places[t - before] == before
        };
        let holes: Vec<usize> = (0..places.len()).filter(|&t| !follows(t)).collect();
        if !holes.is_empty() {
            let covariances = memory.autocovariances(places[places.len() - 1] - places[0] + 1);
            let own = |&t: &usize| Apart::of(t, places, &covariances, 2 * order);
            apart.extend(holes.iter().filter_map(own));
        }
        Self { memory: memory.clone(), length: places.len(), apart }
    }

    /// The weights of the values before one, the nearest first, and the standard deviation of the error.
    pub(super) fn predictor(&self, t: usize) -> (&[f64], f64) {
        match self.apart.binary_search_by_key(&t, |apart| apart.at) {
            Ok(k) => (&self.apart[k].weights, self.apart[k].error),
            Err(_) => self.memory.predictor(t.min(self.memory.order())),
        }
    }

    /// Whitens noise of this kind in place: a triangular map whose inverse is [`Succession::colour`].
    pub fn whiten(&self, values: &mut [f64]) {
        if self.apart.is_empty() {
            return self.memory.whiten(values);
        }
        for t in (0..values.len()).rev() {
            let (weights, error) = self.predictor(t);
            let before = weights.iter().zip(values[..t].iter().rev());
            let predicted: f64 = before.map(|(a, x)| a * x).sum();
            values[t] = (values[t] - predicted) / error;
        }
    }

    /// Transforms white noise into noise of this kind, in place.
    pub fn colour(&self, values: &mut [f64]) {
        for t in 0..values.len() {
            let (weights, error) = self.predictor(t);
            let before = weights.iter().zip(values[..t].iter().rev());
            let predicted: f64 = before.map(|(a, x)| a * x).sum();
            values[t] = predicted + error * values[t];
        }
    }

    /// The logarithm of the determinant of [`Succession::whiten`].
    pub fn log_determinant(&self) -> f64 {
        -(0..self.length.min(self.memory.order()))
            .filter(|t| self.apart.binary_search_by_key(t, |apart| apart.at).is_err())
            .map(|t| self.memory.predictor(t).1.ln())
            .chain(self.apart.iter().map(|apart| apart.error.ln()))
            .sum::<f64>()
    }
}

impl Apart {
    fn of(t: usize, places: &[usize], covariances: &[f64], most: usize) -> Option<Self> {
        let before: Vec<usize> = (t.saturating_sub(most)..t).rev().map(|k| places[k]).collect();
        let covariance = |i: usize, j: usize| covariances[i.abs_diff(j)];
        let size = before.len();
        let among = Matrix::from_fn(size, size, |i, j| covariance(before[i], before[j]));
        let onto: Vec<f64> = before.iter().map(|&i| covariance(i, places[t])).collect();
        let mut weights = onto.clone();
        Cholesky::new(&among).ok()?.solve(&mut weights);
        let explained: f64 = weights.iter().zip(&onto).map(|(w, c)| w * c).sum();
        // The error is not below one: innovations have variance one, and no predictor is better than that from all
        // values before.
        let error = (covariances[0] - explained).max(1.0).sqrt();
        Some(Self { at: t, weights, error })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// A matrix `W` that whitens noise of covariance `C` has `W C W' = I`, and `log|W| = -log|C| / 2`.
    #[test]
    fn values_between_holes_become_white() {
        let memory = Autoregression::of_autocovariances(&[1.0, 0.8, 0.5], 2).0;
        let places: [usize; 11] = [0, 1, 2, 3, 7, 8, 9, 14, 15, 16, 17];
        let covariances = memory.autocovariances(18);
        let n = places.len();
        let c = Matrix::from_fn(n, n, |i, j| covariances[places[i].abs_diff(places[j])]);
        let succession = Succession::new(&memory, &places);
        // The rows of the symmetric C whitened are W C; each of its columns whitened again makes W C W'.
        let twice = |m: &Matrix| {
            let rows = m.iter_rows().map(|row| {
                let mut row = row.to_vec();
                succession.whiten(&mut row);
                row
            });
            Matrix::from_rows(n, rows).transposed()
        };
        let white = twice(&twice(&c));
        for i in 0..n {
            for j in 0..n {
                let unit = f64::from(u8::from(i == j));
                assert!((white[(i, j)] - unit).abs() < 1e-9, "{i} {j} {}", white[(i, j)]);
            }
        }
        let exact = -0.5 * Cholesky::new(&c).unwrap().log_determinant();
        assert!((succession.log_determinant() - exact).abs() < 1e-9);
        let values: Vec<f64> = (0..n).map(|t| (1.3 * t as f64).sin()).collect();
        let mut round = values.clone();
        succession.whiten(&mut round);
        succession.colour(&mut round);
        assert!(values.iter().zip(&round).all(|(x, y)| (x - y).abs() < 1e-12));
    }
}
