//! The noise of one curve, from the differences between its replicates.

use serde::{Deserialize, Serialize};

use super::autoregression::Autoregression;
use crate::linalg::vector::{add_scaled, dot};
use crate::linalg::{Cholesky, Matrix};

/// The highest order of autoregression that is tried.
const MOST: usize = 3;

/// Steps of expectation and maximisation: with them the likelihood rises by less than a hundredth per step.
const STEPS: usize = 20;

/// Fewer independent differences say nothing of how whole replicates differ.
const FEWEST: usize = 3;

/// What whole replicates of a curve differ by, beside their noise: variances.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Wander {
    /// Of an offset, in the response's unit squared.
    pub offset: f64,
    /// Of a gain.
    pub gain: f64,
    /// Of a shift along the last axis, in its unit squared.
    pub clock: f64,
}

impl Wander {
    /// Its variances in the order of [`directions`].
    pub fn variances(&self) -> [f64; 3] {
        [self.offset, self.gain, self.clock]
    }

    fn of([offset, gain, clock]: [f64; 3]) -> Self {
        Self { offset, gain, clock }
    }
}

/// How the replicates of one curve differ from their common mean.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CurveNoise {
    /// The standard deviation of the innovations where the variance has its mean.
    pub sd: f64,
    /// How noise follows from the noise before.
    pub memory: Autoregression,
    /// How fast the variance grows with the square of the response over its mean square; zero: not at all.
    pub level: f64,
    /// What whole replicates differ by.
    pub wander: Wander,
    /// The standard deviation of the noise at each measured value relative to `sd`.
    pub profile: Vec<f64>,
}

/// The differences between replicates of a curve, and what they may be made of.
pub struct Differences {
    /// Independent differences of the covariance of one replicate, one a row: Helmert's contrasts.
    contrasts: Vec<Vec<f64>>,
    /// The directions of [`Wander`].
    directions: [Vec<f64>; 3],
    /// The response that the curve should show.
    response: Vec<f64>,
}

/// What an offset, a gain and a shift along the axis do to a response: one, itself, less its slope.
pub fn directions(response: &[f64], at: &[f64]) -> [Vec<f64>; 3] {
    let last = response.len().saturating_sub(1);
    let slope = |i: usize| {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(last));
        if a == b { 0.0 } else { -(response[b] - response[a]) / (at[b] - at[a]) }
    };
    [vec![1.0; response.len()], response.to_vec(), (0..response.len()).map(slope).collect()]
}

impl Differences {
    /// Of replicates that are complete.
    pub fn new(replicates: &[Vec<f64>], response: &[f64], at: &[f64]) -> Self {
        let mut sum = vec![0.0; response.len()];
        let mut contrasts = Vec::new();
        for (k, replicate) in replicates.iter().enumerate() {
            if k > 0 {
                let k = k as f64;
                let each = sum.iter().zip(replicate);
                contrasts.push(each.map(|(s, y)| (s - k * y) / (k * (k + 1.0)).sqrt()).collect());
            }
            sum.iter_mut().zip(replicate).for_each(|(s, y)| *s += y);
        }
        Self { contrasts, directions: directions(response, at), response: response.to_vec() }
    }

    /// The noise of largest likelihood, its order chosen by the corrected criterion of Akaike (Hurvich and
    /// Tsai, Biometrika 76 (1989) 297), or a given one. `None` below one difference, or without any.
    pub fn noise(&self, order: Option<usize>) -> Option<CurveNoise> {
        let total: f64 = self.contrasts.iter().flatten().map(|x| x * x).sum();
        if total <= 0.0 {
            return None;
        }
        let length = self.response.len();
        let most = MOST.min(length.saturating_sub(2) / 4);
        let orders = order.map_or(0..=most, |order| order.min(most)..=order.min(most));
        let mut best: Option<(f64, Fit<'_>)> = None;
        for order in orders {
            let fit = Fit::new(self, order).run();
            let criterion = fit.criterion();
            if best.as_ref().is_none_or(|(least, _)| criterion < *least) {
                best = Some((criterion, fit));
            }
        }
        best.map(|(_, fit)| fit.noise())
    }

    /// The number of independent differences.
    pub fn count(&self) -> usize {
        self.contrasts.len()
    }

    /// The innovations of all differences, one after another.
    pub fn innovations(&self, noise: &CurveNoise) -> Vec<f64> {
        let mut fit = Fit::of(self, noise);
        fit.wander = noise.wander.variances();
        fit.innovations().concat()
    }

    /// What each difference has of each direction, by least squares weighted with the noise.
    pub fn coefficients(&self, noise: &CurveNoise) -> Vec<[f64; 3]> {
        let fit = Fit::of(self, noise);
        let normal = Matrix::from_fn(3, 3, |i, j| {
            fit.gram[(i, j)] * if i == j { 1.0 + 1e-9 } else { 1.0 }
                + if i == j { f64::MIN_POSITIVE } else { 0.0 }
        });
        let Ok(factor) = Cholesky::new(&normal) else {
            return vec![[0.0; 3]; self.contrasts.len()];
        };
        fit.whitened
            .iter()
            .map(|c| {
                let mut b = fit.onto(c);
                factor.solve(&mut b);
                [b[0], b[1], b[2]]
            })
            .collect()
    }
}

/// Expectation and maximisation: the directions' shares in each difference are what is not seen.
struct Fit<'a> {
    data: &'a Differences,
    order: usize,
    memory: Autoregression,
    variance: f64,
    profile: Vec<f64>,
    level: f64,
    wander: [f64; 3],
    /// Differences and directions, scaled and whitened with innovations of variance one.
    whitened: Vec<Vec<f64>>,
    directions: Vec<Vec<f64>>,
    /// The products of the whitened directions.
    gram: Matrix,
}

impl<'a> Fit<'a> {
    fn new(data: &'a Differences, order: usize) -> Self {
        let count = data.contrasts.len() * data.response.len();
        let variance = data.contrasts.iter().flatten().map(|x| x * x).sum::<f64>() / count as f64;
        let wander = if data.contrasts.len() < FEWEST {
            [0.0; 3]
        } else {
            let size = |d: &Vec<f64>| dot(d, d) / d.len() as f64;
            [0, 1, 2].map(|k| 0.1 * variance / size(&data.directions[k]).max(f64::MIN_POSITIVE))
        };
        let wander = wander.map(|v| if v.is_finite() { v } else { 0.0 });
        let mut fit = Self {
            data,
            order,
            memory: Autoregression::white(),
            variance,
            profile: vec![1.0; data.response.len()],
            level: 0.0,
            wander,
            whitened: Vec::new(),
            directions: Vec::new(),
            gram: Matrix::zeros(3, 3),
        };
        fit.whiten();
        fit
    }

    /// As an earlier fit left it.
    fn of(data: &'a Differences, noise: &CurveNoise) -> Self {
        let mut fit = Self::new(data, noise.memory.order());
        fit.memory = noise.memory.clone();
        fit.variance = noise.sd * noise.sd;
        fit.profile.clone_from(&noise.profile);
        fit.whiten();
        fit
    }

    fn whiten(&mut self) {
        let white = |x: &Vec<f64>| {
            let mut x: Vec<f64> = x.iter().zip(&self.profile).map(|(x, w)| x / w).collect();
            self.memory.whiten(&mut x);
            x
        };
        self.whitened = self.data.contrasts.iter().map(white).collect();
        self.directions = self.data.directions.iter().map(white).collect();
        let products = |i: usize, j: usize| dot(&self.directions[i], &self.directions[j]);
        self.gram = Matrix::from_fn(3, 3, products);
    }

    fn onto(&self, whitened: &[f64]) -> Vec<f64> {
        self.directions.iter().map(|d| dot(d, whitened)).collect()
    }

    /// The matrix `I + V' G V / variance` with `V` the standard deviations of the wander.
    fn inner(&self) -> (Matrix, [f64; 3]) {
        let sd = self.wander.map(f64::sqrt);
        let entry = |i: usize, j: usize| {
            f64::from(u8::from(i == j)) + sd[i] * self.gram[(i, j)] * sd[j] / self.variance
        };
        (Matrix::from_fn(3, 3, entry), sd)
    }

    fn run(mut self) -> Self {
        for step in 0..STEPS {
            self.improve();
            if step == STEPS / 2 && self.find_level() {
                self.whiten();
            }
        }
        self
    }

    /// One step: the expected shares of the directions, then the noise that is left.
    fn improve(&mut self) {
        let (inner, sd) = self.inner();
        let Ok(factor) = Cholesky::new(&inner) else { return };
        let inverse = factor.inverse();
        let posterior = Matrix::from_fn(3, 3, |i, j| sd[i] * inverse[(i, j)] * sd[j]);
        let n = self.whitened.len() as f64;
        let length = self.data.response.len();
        let mut squares = [0.0; 3];
        let mut covariances = vec![0.0; self.order + 1];
        for (contrast, whitened) in self.data.contrasts.iter().zip(&self.whitened) {
            let onto = self.onto(whitened);
            let share: [f64; 3] = [0, 1, 2].map(|i| dot(posterior.row(i), &onto) / self.variance);
            (0..3).for_each(|i| squares[i] += share[i] * share[i]);
            let rest: Vec<f64> = (0..length)
                .map(|t| {
                    let explained: f64 =
                        (0..3).map(|i| share[i] * self.data.directions[i][t]).sum();
                    (contrast[t] - explained) / self.profile[t]
                })
                .collect();
            for (lag, c) in covariances.iter_mut().enumerate() {
                *c += dot(&rest[lag..], &rest[..length - lag]);
            }
        }
        self.add_uncertainty(&posterior, n, &mut covariances);
        for (lag, c) in covariances.iter_mut().enumerate() {
            *c /= n * (length - lag) as f64;
        }
        if n >= FEWEST as f64 {
            (0..3).for_each(|i| self.wander[i] = squares[i] / n + posterior[(i, i)]);
        }
        let (memory, variance) = Autoregression::of_autocovariances(&covariances, self.order);
        if variance > 0.0 && variance.is_finite() {
            (self.memory, self.variance) = (memory, variance);
        }
        self.whiten();
    }

    /// What the shares' own uncertainty adds to the products of the noise.
    fn add_uncertainty(&self, posterior: &Matrix, n: f64, covariances: &mut [f64]) {
        let length = self.data.response.len();
        let scaled = |i: usize| -> Vec<f64> {
            self.data.directions[i].iter().zip(&self.profile).map(|(x, w)| x / w).collect()
        };
        let scaled = [scaled(0), scaled(1), scaled(2)];
        for (lag, c) in covariances.iter_mut().enumerate() {
            for i in 0..3 {
                for j in 0..3 {
                    let products = dot(&scaled[i][lag..], &scaled[j][..length - lag]);
                    *c += n * posterior[(i, j)] * products;
                }
            }
        }
    }

    /// The whitened differences without the expected shares of the directions.
    fn innovations(&self) -> Vec<Vec<f64>> {
        let (inner, sd) = self.inner();
        let Ok(factor) = Cholesky::new(&inner) else { return self.whitened.clone() };
        let without = |whitened: &Vec<f64>| {
            let mut share = self.onto(whitened);
            share.iter_mut().zip(&sd).for_each(|(x, s)| *x *= s / self.variance);
            factor.solve(&mut share);
            let mut rest = whitened.clone();
            for ((direction, share), sd) in self.directions.iter().zip(&share).zip(&sd) {
                add_scaled(&mut rest, -share * sd, direction);
            }
            rest
        };
        self.whitened.iter().map(without).collect()
    }

    /// Whether the variance grows with the square of the response, and how fast: the regression of the
    /// squares of the innovations, taken as independent (Breusch and Pagan, Econometrica 47 (1979) 1287). Beyond four of its
    /// standard errors it does.
    fn find_level(&mut self) -> bool {
        let (n, length) = (self.whitened.len() as f64, self.data.response.len());
        let square = self.data.response.iter().map(|y| y * y).sum::<f64>() / length as f64;
        if square <= 0.0 || n < FEWEST as f64 || length < 8 {
            return false;
        }
        let level: Vec<f64> = self.data.response.iter().map(|y| y * y / square - 1.0).collect();
        let spread = dot(&level, &level);
        let innovations = self.innovations();
        let mean = |t: usize| innovations.iter().map(|c| c[t] * c[t]).sum::<f64>() / n;
        let relative: Vec<f64> = (0..length).map(|t| mean(t) / self.variance - 1.0).collect();
        let slope = dot(&level, &relative) / spread;
        let error = (2.0 / (n * spread)).sqrt();
        if !(slope > 4.0 * error) {
            return false;
        }
        // variance = 1 + slope (m^2 / mean - 1), as `(1 + level m^2 / mean) / (1 + level)`.
        let slope = slope.min(0.95);
        self.level = slope / (1.0 - slope);
        self.profile = level.iter().map(|l| (1.0 + slope * l).max(0.05).sqrt()).collect();
        true
    }

    /// Minus twice the log-likelihood with the corrected penalty of Akaike.
    fn criterion(&self) -> f64 {
        let (inner, sd) = self.inner();
        let Ok(factor) = Cholesky::new(&inner) else { return f64::INFINITY };
        let (n, length) = (self.whitened.len() as f64, self.data.response.len());
        let scale: f64 = self.profile.iter().map(|w| w.ln()).sum();
        let log_determinant = length as f64 * self.variance.ln()
            + 2.0 * (scale - self.memory.log_determinant(length))
            + factor.log_determinant();
        let mut quadratic = 0.0;
        for whitened in &self.whitened {
            let mut onto = self.onto(whitened);
            onto.iter_mut().zip(&sd).for_each(|(x, s)| *x *= s / self.variance);
            quadratic += dot(whitened, whitened) / self.variance - factor.quadratic(&onto);
        }
        let unknowns = (self.order + 4) as f64;
        let count = n * length as f64;
        let correction = 2.0 * unknowns * count / (count - unknowns - 1.0).max(1.0);
        n * log_determinant + quadratic + correction
    }

    fn noise(self) -> CurveNoise {
        CurveNoise {
            sd: self.variance.sqrt(),
            memory: self.memory,
            level: self.level,
            wander: Wander::of(self.wander),
            profile: self.profile,
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::math::random::{Stream, normal};

    /// Replicates made with known noise: autoregression 0.5 with innovations of sd 1, offsets of sd 2, gains of sd 0.1.
    fn replicates(count: usize, length: usize) -> (Vec<Vec<f64>>, Vec<f64>, Vec<f64>) {
        let at: Vec<f64> = (0..length).map(|t| t as f64).collect();
        let response: Vec<f64> = at.iter().map(|t| 20.0 * (0.2 * t).sin()).collect();
        let memory = Autoregression::of_autocovariances(&[1.0, 0.5], 1).0;
        let replicate = |r: usize| {
            let mut rng = Stream::root(11).at(r as u64).generator();
            let (offset, gain) = (2.0 * normal(&mut rng), 1.0 + 0.1 * normal(&mut rng));
            let mut noise: Vec<f64> = (0..length).map(|_| normal(&mut rng)).collect();
            memory.colour(&mut noise);
            response.iter().zip(noise).map(|(y, e)| gain * y + offset + e).collect()
        };
        ((0..count).map(replicate).collect(), response, at)
    }

    /// Standard errors: of a variance from n normal numbers `sqrt(2 / n)` of itself; of an
    /// autoregression's coefficient `sqrt((1 - a^2) / N)` (Brockwell and Davis, section 8.1).
    #[test]
    fn known_noise_is_found() {
        let (count, length) = (200, 80);
        let (replicates, response, at) = replicates(count, length);
        let differences = Differences::new(&replicates, &response, &at);
        // The criterion of Akaike takes an order too high in one case of six.
        assert!((1..=2).contains(&differences.noise(None).unwrap().memory.order()));
        let noise = differences.noise(Some(1)).unwrap();
        let (n, total) = (count as f64 - 1.0, (count as f64 - 1.0) * length as f64);
        let a = noise.memory.coefficients()[0];
        assert!((a - 0.5).abs() < 4.0 * (0.75 / total).sqrt(), "{a}");
        assert!((noise.sd.powi(2) - 1.0).abs() < 4.0 * (2.0 / total).sqrt(), "{}", noise.sd);
        assert!((noise.wander.offset / 4.0 - 1.0).abs() < 4.0 * (2.0 / n).sqrt(), "{noise:?}");
        assert!((noise.wander.gain / 0.01 - 1.0).abs() < 4.0 * (2.0 / n).sqrt(), "{noise:?}");
        // A shift of sd s moves the curve by about 2.8 s; what is found is far below the noise.
        assert!(noise.wander.clock.sqrt() * 2.8 < 0.1, "{noise:?}");
        assert!(noise.level.abs() < f64::MIN_POSITIVE);
    }

    #[test]
    fn a_variance_that_grows_with_the_response_is_found() {
        let length = 100;
        let at: Vec<f64> = (0..length).map(f64::from).collect();
        let response: Vec<f64> = at.iter().map(|t| 0.1 * t).collect();
        let replicate = |r: u64| {
            let mut rng = Stream::root(12).at(r).generator();
            response.iter().map(|y| y + (1.0 + 0.2 * y * y).sqrt() * normal(&mut rng)).collect()
        };
        let replicates: Vec<Vec<f64>> = (0..40).map(replicate).collect();
        let noise = Differences::new(&replicates, &response, &at).noise(None).unwrap();
        let square = response.iter().map(|y| y * y).sum::<f64>() / f64::from(length);
        // 0.2 m^2 = level m^2 / mean: level = 0.2 mean; the error of the slope is sqrt(2 / (n spread)).
        let expected = 0.2 * square;
        let (found, truth) = (noise.level / (1.0 + noise.level), expected / (1.0 + expected));
        assert!((found - truth).abs() < 0.1, "{found} {truth}");
    }
}
