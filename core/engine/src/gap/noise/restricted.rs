//! Autoregressive noise about an unknown combination of known curves, by restricted likelihood.
//!
//! The restricted likelihood is that of the curve projected onto the complement of the known curves, so that fitting
//! them does not reduce the estimate of the noise (Harville, Journal of the American Statistical Association 72 (1977)
//! 320; for autocorrelated noise about smooth curves: Krivobokova and Kauermann, Journal of the American Statistical
//! Association 102 (2007) 1328).

use lacuna_linalg::{Cholesky, Matrix};

use super::autoregression::Autoregression;
use super::lagged::Lagged;

/// The highest order of autoregression that is tried.
pub(super) const MOST: usize = 3;

/// Smallest number of values per unknown of the autoregression.
const EACH: usize = 8;

/// Smallest effective number of independent values in a record of noise: a variation that is correlated over a larger
/// part of the record is not noise but a feature that the record shows once.
const INDEPENDENT: f64 = 8.0;

/// Longest memory of noise, in steps of the record: what varies more slowly is not noise of an instrument unless the
/// study states it (`memory` of `noise` in `[measurements]`).
const LONGEST: f64 = 20.0;

/// Mean of the exponential prior of the memory beyond the first step, in steps.
const USUAL: f64 = 5.0;

/// Reflection coefficients are sought as `tanh z`, with `z` up to this value: 0.995.
const FARTHEST: f64 = 3.0;

/// Smallest `z` that is tried.
const NEAREST: f64 = -1.5;

/// Distance between the values of `z` that are tried first.
const COARSE: f64 = 0.75;

/// Steps of each golden section search, which reduce the interval to 1/18: less than the standard error of a
/// coefficient.
const STEPS: usize = 6;

/// The golden section.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// Parts of a law that are known beforehand.
#[derive(Debug, Clone, Default)]
pub(super) struct Known {
    /// The standard deviation of a single value.
    pub size: Option<f64>,
    /// The autocorrelation.
    pub memory: Option<Autoregression>,
}

/// A curve of noise plus an unknown combination of known curves.
pub(super) struct Restricted<'a> {
    /// The curve.
    pub values: &'a [f64],
    /// Known curves of which it contains unknown amounts; linearly independent.
    pub columns: &'a [Vec<f64>],
    /// The places of the values.
    pub places: &'a [usize],
    /// The known parts of the law.
    pub known: &'a Known,
}

/// An autoregression with the standard deviation of its innovations.
pub(super) struct Law {
    pub sd: f64,
    pub memory: Autoregression,
    /// Minus twice the log-likelihood of the whole curve, with the penalty of the order: laws about other columns are
    /// compared by it.
    pub deviance: f64,
}

/// Minus twice the restricted log-likelihood at the innovation variance, and minus twice the log-likelihood of the whole
/// curve; with the prior of the memory, if it is not known.
struct Judged {
    restricted: f64,
    whole: f64,
    variance: f64,
}

impl Restricted<'_> {
    /// The number of values minus the number of columns.
    fn freedom(&self) -> usize {
        self.values.len().saturating_sub(self.columns.len())
    }

    /// The known curves and the curve itself, for autoregressions up to an order.
    fn lagged(&self, most: usize) -> Lagged<'_> {
        let columns = self.columns.iter().map(|column| &column[..]);
        Lagged::new(columns.chain([self.values]).collect(), self.places, most)
    }

    /// The law of largest likelihood, with the order, up to `most`, chosen by the corrected Akaike criterion; `None` if
    /// too few values are left, or if their residual is zero.
    pub fn law(&self, most: usize) -> Option<Law> {
        let freedom = self.freedom();
        let most = most.min((freedom / EACH).saturating_sub(1));
        if freedom < EACH {
            return None;
        }
        if let Some(memory) = &self.known.memory {
            let lagged = self.lagged(memory.order());
            return Some(self.judged(&lagged, memory)?.law(memory.clone(), 0.0));
        }
        let lagged = self.lagged(most);
        let mut z: Vec<f64> = Vec::new();
        let mut best: Option<(f64, Law)> = None;
        for order in 0..=most {
            if order > 0 {
                z.push(0.0);
                self.improve(&lagged, &mut z);
            }
            let judged = self.at(&lagged, &z)?;
            let (k, n) = ((order + 1) as f64, freedom as f64);
            let penalty = 2.0 * k * n / (n - k - 1.0);
            let criterion = judged.restricted + penalty;
            if best.as_ref().is_none_or(|(least, _)| criterion < *least) {
                best = Some((criterion, judged.law(memory(&z), penalty)));
            }
        }
        best.map(|(_, law)| law)
    }

    /// Optimises the last coefficient, then all in turn beginning with the last.
    fn improve(&self, lagged: &Lagged<'_>, z: &mut [f64]) {
        let last = z.len() - 1;
        let count = ((FARTHEST - NEAREST) / COARSE) as usize;
        let coarse = (0..=count).map(|k| NEAREST + k as f64 * COARSE);
        let tried = coarse.map(|x| (self.deviance(lagged, z, last, x), x));
        let best = tried.min_by(|a, b| a.0.total_cmp(&b.0));
        z[last] = best.map_or(0.0, |(_, x)| x);
        for j in (0..=last).rev() {
            z[j] = self.section(lagged, z, j);
        }
    }

    /// The best value of a coefficient near its present one, by golden section.
    fn section(&self, lagged: &Lagged<'_>, z: &[f64], j: usize) -> f64 {
        let (mut low, mut high) = ((z[j] - COARSE).max(-FARTHEST), (z[j] + COARSE).min(FARTHEST));
        let inner =
            |low: f64, high: f64| [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
        let mut at = inner(low, high);
        let mut value = at.map(|x| self.deviance(lagged, z, j, x));
        for _ in 0..STEPS {
            if value[0] < value[1] {
                high = at[1];
                at = [inner(low, high)[0], at[0]];
                value = [self.deviance(lagged, z, j, at[0]), value[0]];
            } else {
                low = at[0];
                at = [at[1], inner(low, high)[1]];
                value = [value[1], self.deviance(lagged, z, j, at[1])];
            }
        }
        at[usize::from(value[1] < value[0])]
    }

    fn deviance(&self, lagged: &Lagged<'_>, z: &[f64], j: usize, x: f64) -> f64 {
        let mut moved = z.to_vec();
        moved[j] = x;
        self.at(lagged, &moved).map_or(f64::INFINITY, |judged| judged.restricted)
    }

    /// Minus twice the log prior density of a memory; `None` if it is too long for noise or for this record. The memory
    /// is the number of values that count as one for the variance, `sum of rho^2` over all lags (Bayley and Hammersley,
    /// Supplement to the Journal of the Royal Statistical Society 8 (1946) 184): for noise of first order about the
    /// steps over which its correlation falls to 1/e.
    fn prior(&self, memory: &Autoregression) -> Option<f64> {
        let covariances = memory.autocovariances(self.values.len());
        let squares: f64 = covariances.iter().map(|c| (c / covariances[0]).powi(2)).sum();
        let steps = 2.0 * squares - 1.0;
        let longest = LONGEST.min(self.values.len() as f64 / INDEPENDENT);
        (steps <= longest).then_some(2.0 * (steps - 1.0) / USUAL)
    }

    fn at(&self, lagged: &Lagged<'_>, z: &[f64]) -> Option<Judged> {
        let memory = memory(z);
        let prior = self.prior(&memory)?;
        let judged = self.judged(lagged, &memory)?;
        let (restricted, whole) = (judged.restricted + prior, judged.whole + prior);
        Some(Judged { restricted, whole, ..judged })
    }

    fn judged(&self, lagged: &Lagged<'_>, memory: &Autoregression) -> Option<Judged> {
        let succession = memory.on(self.places);
        let products = lagged.gram(memory, &succession);
        let size = self.columns.len();
        let at = |k: usize, l: usize| products[k * (k + 1) / 2 + l];
        let mut square = at(size, size);
        let of_noise = -2.0 * succession.log_determinant();
        let mut of_columns = 0.0;
        if size > 0 {
            let gram = Matrix::from_fn(size, size, |i, j| at(i.max(j), i.min(j)));
            let factor = Cholesky::new(&gram).ok()?;
            let onto: Vec<f64> = (0..size).map(|l| at(size, l)).collect();
            square -= factor.quadratic(&onto);
            of_columns = factor.log_determinant();
        }
        let (n, all) = (self.freedom() as f64, self.values.len() as f64);
        let given = self.known.size.map(|size| size * size / memory.variance());
        let variance = given.unwrap_or(square / n);
        // About the columns `square` has the expectation of `n` variances, about the true curve that of all.
        let misfit = square / variance;
        let found = variance > 0.0 && (of_noise + of_columns).is_finite();
        found.then(|| Judged {
            restricted: n * variance.ln() + of_noise + of_columns + misfit,
            whole: all * variance.ln() + of_noise + misfit,
            variance,
        })
    }
}

impl Judged {
    fn law(&self, memory: Autoregression, penalty: f64) -> Law {
        Law { sd: self.variance.sqrt(), memory, deviance: self.whole + penalty }
    }
}

fn memory(z: &[f64]) -> Autoregression {
    let reflections: Vec<f64> = z.iter().map(|z| z.tanh()).collect();
    Autoregression::of_reflections(&reflections)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lacuna::math::random::{Stream, normal};

    fn noise(a: f64, length: usize, stream: &Stream) -> Vec<f64> {
        let mut rng = stream.generator();
        let mut values: Vec<f64> = (0..length).map(|_| normal(&mut rng)).collect();
        Autoregression::of_reflections(&[a]).colour(&mut values);
        values
    }

    /// About a parabola least squares finds the coefficient of a short curve about `(3 + 5 a) / n` too small and more
    /// (Cheang and Reinsel, Journal of the American Statistical Association 95 (2000) 1173); the restricted likelihood
    /// does not. The mean over B curves has the standard error `sqrt((1 - a^2) / (n B))`.
    #[test]
    fn what_is_fitted_does_not_shorten_the_memory() {
        let (length, curves, a) = (60, 200, 0.6);
        let columns: Vec<Vec<f64>> = (0..3)
            .map(|k| (0..length).map(|t| (f64::from(t) / 60.0 - 0.5).powi(k)).collect())
            .collect();
        let places: Vec<usize> = (0..length as usize).collect();
        let found = (0..curves).map(|b| {
            let values = noise(a, length as usize, &Stream::root(4).at(b));
            let mut z = [0.0];
            let known = &Known::default();
            let record = Restricted { values: &values, columns: &columns, places: &places, known };
            record.improve(&record.lagged(1), &mut z);
            z[0].tanh()
        });
        let mean = found.sum::<f64>() / curves as f64;
        let error = ((1.0 - a * a) / (f64::from(length) * curves as f64)).sqrt();
        assert!((mean - a).abs() < 0.02 + 4.0 * error, "{mean} {error}");
    }
}
