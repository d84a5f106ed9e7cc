//! Autoregressive noise along a curve: `e_t = a_1 e_{t-1} + ... + a_p e_{t-p} + w_t`.
//!
//! Brockwell and Davis, Time Series: Theory and Methods, 2nd ed., sections 5.2 (Durbin-Levinson) and 8.

use serde::{Deserialize, Serialize};

use super::succession::Succession;

/// The largest reflection coefficient: a random walk is no stationary noise.
const LARGEST: f64 = 0.995;

/// A stationary autoregression with innovations of variance one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Autoregression {
    /// The best predictors from `0, 1, ..., p` values before, the nearest first.
    predictors: Vec<Vec<f64>>,
    /// The standard deviation of the error of each predictor, that of the last being one.
    errors: Vec<f64>,
}

impl Autoregression {
    /// The autoregression of white noise.
    pub fn white() -> Self {
        Self { predictors: vec![Vec::new()], errors: vec![1.0] }
    }

    /// The autoregression of this order with the autocovariances `c_0, c_1, ..., c_order` (Durbin-Levinson), and the
    /// variance of its innovations. Reflection coefficients that would make it unstable are bounded.
    pub fn of_autocovariances(c: &[f64], order: usize) -> (Self, f64) {
        let mut predictors = vec![Vec::new()];
        let mut variances = vec![c[0]];
        for m in 1..=order {
            let last: &Vec<f64> = &predictors[m - 1];
            let variance = variances[m - 1];
            if variance <= 0.0 {
                return (Self::white(), c[0].max(0.0));
            }
            let predicted: f64 = last.iter().zip((0..m).rev()).map(|(a, lag)| a * c[lag]).sum();
            let reflection = ((c[m] - predicted) / variance).clamp(-LARGEST, LARGEST);
            predictors.push(longer(last, reflection));
            variances.push(variance * (1.0 - reflection * reflection));
        }
        (Self::of(predictors, &variances), variances[order])
    }

    /// The autoregression with these reflection coefficients (partial autocorrelations), each held inside the bounds of
    /// what is stationary.
    pub fn of_reflections(reflections: &[f64]) -> Self {
        let mut predictors = vec![Vec::new()];
        let mut variances = vec![1.0];
        for (m, reflection) in reflections.iter().enumerate() {
            let reflection = reflection.clamp(-LARGEST, LARGEST);
            predictors.push(longer(&predictors[m], reflection));
            variances.push(variances[m] * (1.0 - reflection * reflection));
        }
        Self::of(predictors, &variances)
    }

    fn of(predictors: Vec<Vec<f64>>, variances: &[f64]) -> Self {
        let innovation = variances[variances.len() - 1];
        let errors = variances.iter().map(|v| (v / innovation).sqrt()).collect();
        Self { predictors, errors }
    }

    /// The autoregression at increasing indices of a grid.
    pub fn on(&self, places: &[usize]) -> Succession {
        Succession::new(self, places)
    }

    /// The best predictor from so many values before, at most the order, and the standard deviation of its error.
    pub(super) fn predictor(&self, values: usize) -> (&[f64], f64) {
        (&self.predictors[values], self.errors[values])
    }

    /// The autocovariances at the lags `0, 1, ..., count - 1`.
    pub(super) fn autocovariances(&self, count: usize) -> Vec<f64> {
        let mut all = vec![self.variance()];
        for lag in 1..count {
            let predictor = &self.predictors[lag.min(self.order())];
            all.push(predictor.iter().zip(all.iter().rev()).map(|(a, c)| a * c).sum());
        }
        all
    }

    /// The order `p`.
    pub fn order(&self) -> usize {
        self.predictors.len() - 1
    }

    /// The coefficients `a_1, ..., a_p`.
    pub fn coefficients(&self) -> &[f64] {
        &self.predictors[self.order()]
    }

    /// The variance of the noise when its innovations have variance one.
    pub fn variance(&self) -> f64 {
        self.errors[0] * self.errors[0]
    }

    /// The sum of its autocorrelations over all lags: the factor by which it increases the variance of a mean of many
    /// values.
    pub fn inflation(&self) -> f64 {
        let sum: f64 = self.coefficients().iter().sum();
        1.0 / ((1.0 - sum).powi(2) * self.variance())
    }

    /// Whitens noise of this kind, in place: a triangular map whose inverse is [`Autoregression::colour`].
    pub fn whiten(&self, values: &mut [f64]) {
        for t in (0..values.len()).rev() {
            let m = t.min(self.order());
            let predicted: f64 = self.predictors[m]
                .iter()
                .zip(values[t - m..t].iter().rev())
                .map(|(a, x)| a * x)
                .sum();
            values[t] = (values[t] - predicted) / self.errors[m];
        }
    }

    /// Makes noise of this kind from white noise, in place.
    pub fn colour(&self, values: &mut [f64]) {
        for t in 0..values.len() {
            let m = t.min(self.order());
            let predicted: f64 = self.predictors[m]
                .iter()
                .zip(values[t - m..t].iter().rev())
                .map(|(a, x)| a * x)
                .sum();
            values[t] = predicted + self.errors[m] * values[t];
        }
    }

    /// The logarithm of the determinant of [`Autoregression::whiten`] on a curve of this length.
    pub fn log_determinant(&self, length: usize) -> f64 {
        let first = length.min(self.order());
        -self.errors[..first].iter().map(|e| e.ln()).sum::<f64>()
    }
}

/// The predictor from one value more, by Durbin's and Levinson's step with this reflection coefficient.
fn longer(last: &[f64], reflection: f64) -> Vec<f64> {
    let m = last.len();
    let mut next: Vec<f64> = (0..m).map(|i| last[i] - reflection * last[m - 1 - i]).collect();
    next.push(reflection);
    next
}

#[cfg(test)]
mod tests {
    use super::*;

    /// AR(1) with coefficient a: autocovariances `a^k / (1 - a^2)`, precision matrix tridiagonal
    /// with `1, 1 + a^2, ..., 1` and `-a` (Brockwell and Davis, example 5.2).
    #[test]
    fn whitening_of_first_order_gives_the_known_precision() {
        let a = 0.6_f64;
        let covariance: Vec<f64> = (0..4).map(|k| a.powi(k) / (1.0 - a * a)).collect();
        let (noise, innovation) = Autoregression::of_autocovariances(&covariance, 1);
        assert!((innovation - 1.0).abs() < 1e-12);
        let n = 5;
        let columns: Vec<Vec<f64>> = (0..n)
            .map(|j| {
                let mut unit = vec![0.0; n];
                unit[j] = 1.0;
                noise.whiten(&mut unit);
                unit
            })
            .collect();
        for i in 0..n {
            for j in 0..n {
                let found: f64 = columns[i].iter().zip(&columns[j]).map(|(x, y)| x * y).sum();
                let expected = match i.abs_diff(j) {
                    0 if i == 0 || i == n - 1 => 1.0,
                    0 => 1.0 + a * a,
                    1 => -a,
                    _ => 0.0,
                };
                assert!((found - expected).abs() < 1e-12, "{i} {j}: {found} {expected}");
            }
        }
        assert!((noise.log_determinant(n) - 0.5 * (1.0 - a * a).ln()).abs() < 1e-12);
        assert!((noise.inflation() - (1.0 + a) / (1.0 - a)).abs() < 1e-12);
    }

    #[test]
    fn colouring_undoes_whitening() {
        let (noise, _) = Autoregression::of_autocovariances(&[1.0, 0.7, 0.3, 0.2], 3);
        let values: Vec<f64> = (0..9).map(|t| f64::from(t * t % 7) - 3.0).collect();
        let mut round = values.clone();
        noise.whiten(&mut round);
        noise.colour(&mut round);
        assert!(values.iter().zip(&round).all(|(x, y)| (x - y).abs() < 1e-12));
    }
}
