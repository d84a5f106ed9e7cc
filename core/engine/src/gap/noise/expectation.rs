//! The noise of largest likelihood by expectation and maximisation (Dempster, Laird and Rubin, Journal of the Royal
//! Statistical Society B 39 (1977) 1).

use lacuna_linalg::vector::{add_scaled, dot};

use super::autoregression::Autoregression;
use super::curve::{CurveNoise, Differences, ReplicateVariation};
use super::products::Products;
use super::square::{self, Factor, Square, square};

/// Number of steps of expectation and maximisation, after which the log-likelihood rises by less than 0.01 per step.
const STEPS: usize = 20;

/// Smallest number of independent differences that determine random effects of whole replicates.
const FEWEST: usize = 3;

/// Expectation and maximisation; the coefficients of the directions in each difference are the missing data.
pub(super) struct Expectation<'a> {
    data: &'a Differences,
    order: usize,
    memory: Autoregression,
    variance: f64,
    profile: Vec<f64>,
    level: f64,
    wander: [f64; 3],
    /// Differences and directions, scaled and whitened with innovations of variance one.
    pub whitened: Vec<Vec<f64>>,
    directions: Vec<Vec<f64>>,
    /// The products of the whitened directions.
    pub gram: Square,
    /// The products of each whitened difference with the whitened directions.
    onto: Vec<[f64; 3]>,
    products: Products,
}

impl<'a> Expectation<'a> {
    pub fn new(data: &'a Differences, order: usize) -> Self {
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
            gram: [[0.0; 3]; 3],
            onto: Vec::new(),
            products: Products::default(),
        };
        fit.whiten();
        fit
    }

    /// The state at the end of an earlier fit.
    pub fn of(data: &'a Differences, noise: &CurveNoise) -> Self {
        let mut fit = Self::new(data, noise.memory.order());
        fit.memory = noise.memory.clone();
        fit.variance = noise.sd * noise.sd;
        fit.profile.clone_from(&noise.profile);
        fit.wander = noise.wander.variances();
        fit.whiten();
        fit
    }

    /// Curves divided by the profile.
    fn scaled(&self, curves: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let scale = |x: &Vec<f64>| x.iter().zip(&self.profile).map(|(x, w)| x / w).collect();
        curves.iter().map(scale).collect()
    }

    fn whiten(&mut self) {
        let white = |mut curves: Vec<Vec<f64>>| {
            for x in &mut curves {
                self.memory.whiten(x);
            }
            curves
        };
        let whitened = white(self.scaled(&self.data.contrasts));
        let directions = white(self.scaled(&self.data.directions));
        self.gram = square(|i, j| dot(&directions[i], &directions[j]));
        (self.whitened, self.directions) = (whitened, directions);
    }

    /// Computes the products that do not change with the noise.
    fn prepare(&mut self) {
        let contrasts = self.scaled(&self.data.contrasts);
        let directions = self.scaled(&self.data.directions);
        self.products = Products::new(&contrasts, &directions, self.order);
        self.project();
    }

    /// Computes the products of the whitened curves.
    fn project(&mut self) {
        let (products, memory) = (&self.products, &self.memory);
        let gram = |i: usize, j: usize| products.directions[i][j].whitened(memory);
        self.gram = square(gram);
        let onto = products.mixed.iter().map(|p| [0, 1, 2].map(|i| p[i].whitened(memory)));
        self.onto = onto.collect();
    }

    pub fn onto(&self, whitened: &[f64]) -> [f64; 3] {
        [0, 1, 2].map(|k| dot(&self.directions[k], whitened))
    }

    /// The products with the directions, in units of the random effects, over the variance of the innovations.
    fn scaled_onto(&self, whitened: &[f64], sd: &[f64; 3]) -> [f64; 3] {
        let onto = self.onto(whitened);
        [0, 1, 2].map(|k| onto[k] * (sd[k] / self.variance))
    }

    /// The matrix `I + V' G V / variance` with `V` the standard deviations of the random effects.
    fn inner(&self) -> (Square, [f64; 3]) {
        let sd = self.wander.map(f64::sqrt);
        let entry = |i: usize, j: usize| {
            f64::from(u8::from(i == j)) + sd[i] * self.gram[i][j] * sd[j] / self.variance
        };
        (square(entry), sd)
    }

    pub fn run(mut self) -> Self {
        self.prepare();
        for step in 0..STEPS {
            self.improve();
            if step == STEPS / 2 {
                self.whiten();
                if self.find_level() {
                    self.prepare();
                }
            }
        }
        self.whiten();
        self
    }

    /// One step: the expected coefficients of the directions, then the noise that remains.
    fn improve(&mut self) {
        let (inner, sd) = self.inner();
        let Some(factor) = Factor::new(&inner) else { return };
        let inverse = factor.inverse();
        let posterior = square(|i, j| sd[i] * inverse[i][j] * sd[j]);
        let n = self.onto.len() as f64;
        let length = self.data.response.len();
        let shares = self.onto.iter().map(|onto| -> [f64; 3] {
            posterior.map(|row| square::dot(&row, onto) / self.variance)
        });
        let shares: Vec<[f64; 3]> = shares.collect();
        // The second moments of the coefficients consist of the products of their expectations and of their posterior
        // covariance.
        let expected = |i: usize, j: usize| shares.iter().map(|s| s[i] * s[j]).sum::<f64>();
        let moments = square(|i, j| expected(i, j) + n * posterior[i][j]);
        let products = &self.products;
        let covariance = |lag: usize| {
            let mut sum = products.own[lag];
            for (share, mixed) in shares.iter().zip(&products.mixed) {
                sum -= (0..3).map(|i| share[i] * mixed[i].around(lag)).sum::<f64>();
            }
            for (moments, row) in moments.iter().zip(&products.directions) {
                sum += moments.iter().zip(row).map(|(m, own)| m * own.lagged(lag)).sum::<f64>();
            }
            sum / (n * (length - lag) as f64)
        };
        let covariances: Vec<f64> = (0..=self.order).map(covariance).collect();
        if n >= FEWEST as f64 {
            (0..3).for_each(|i| self.wander[i] = moments[i][i] / n);
        }
        let (memory, variance) = Autoregression::of_autocovariances(&covariances, self.order);
        if variance > 0.0 && variance.is_finite() {
            (self.memory, self.variance) = (memory, variance);
        }
        self.project();
    }

    /// The whitened differences without the expected contributions of the directions.
    pub fn innovations(&self) -> Vec<Vec<f64>> {
        let (inner, sd) = self.inner();
        let Some(factor) = Factor::new(&inner) else { return self.whitened.clone() };
        let without = |whitened: &Vec<f64>| {
            let share = factor.solve(self.scaled_onto(whitened, &sd));
            let mut rest = whitened.clone();
            for ((direction, share), sd) in self.directions.iter().zip(&share).zip(&sd) {
                add_scaled(&mut rest, -share * sd, direction);
            }
            rest
        };
        self.whitened.iter().map(without).collect()
    }

    /// Estimates the slope of the variance by the square of the response, from the regression of the squared
    /// innovations, taken as independent (Breusch and Pagan, Econometrica 47 (1979) 1287). Returns true if it is more
    /// than four standard errors above zero.
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
        let clear = slope > 4.0 * error;
        if !clear {
            return false;
        }
        // variance = 1 + slope (m^2 / mean - 1), as `(1 + level m^2 / mean) / (1 + level)`.
        let slope = slope.min(0.95);
        self.level = slope / (1.0 - slope);
        self.profile = level.iter().map(|l| (1.0 + slope * l).max(0.05).sqrt()).collect();
        true
    }

    /// Minus twice the log-likelihood, with the penalty of the corrected Akaike criterion.
    pub fn criterion(&self) -> f64 {
        let (inner, sd) = self.inner();
        let Some(factor) = Factor::new(&inner) else { return f64::INFINITY };
        let (n, length) = (self.whitened.len() as f64, self.data.response.len());
        let scale: f64 = self.profile.iter().map(|w| w.ln()).sum();
        let log_determinant = length as f64 * self.variance.ln()
            + 2.0 * (scale - self.memory.log_determinant(length))
            + factor.log_determinant();
        let mut quadratic = 0.0;
        for whitened in &self.whitened {
            let onto = self.scaled_onto(whitened, &sd);
            quadratic += dot(whitened, whitened) / self.variance - factor.quadratic(onto);
        }
        let unknowns = (self.order + 4) as f64;
        let count = n * length as f64;
        let correction = 2.0 * unknowns * count / (count - unknowns - 1.0).max(1.0);
        n * log_determinant + quadratic + correction
    }

    pub fn noise(self) -> CurveNoise {
        CurveNoise {
            sd: self.variance.sqrt(),
            memory: self.memory,
            level: self.level,
            wander: ReplicateVariation::of(self.wander),
            profile: self.profile,
        }
    }
}
