//! Mixtures of normal distributions of normal scores, fitted to draws by expectation and maximisation (Dempster, Laird and
//! Rubin, J. R. Stat. Soc. B 39 (1977) 1). The number of components is that with the largest log density of draws that the
//! fit did not use.

use rand::Rng;
use serde::Serialize;

use crate::math::moments::log_sum;
use crate::math::random::{Stream, normal, uniform};
use crate::math::special::HALF_LN_TWO_PI;
use crate::matrix::Matrix;

/// A mixture of normal distributions in several dimensions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mixture {
    components: Vec<Component>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Component {
    weight: f64,
    mean: Vec<f64>,
    /// Lower triangular Cholesky factor of the covariance, by rows.
    factor: Vec<Vec<f64>>,
}

/// Largest number of components.
const MOST: usize = 12;
/// Draws per free number of a mixture, at least.
const PER_NUMBER: usize = 10;
/// Steps of a fit, and the gain in mean log density below which it ends.
const STEPS: usize = 200;
const GAIN: f64 = 1e-5;
/// Smallest variance added to every direction. The scores have a variance of about one.
const RIDGE: f64 = 1e-4;
/// Starts of a fit, of which the best is kept.
const STARTS: u64 = 2;

impl Mixture {
    /// The mixture fitted to `draws`, with the number of components of the largest mean log density at `others`.
    pub fn fit(draws: &[Vec<f64>], others: &[Vec<f64>], stream: &Stream) -> Option<Self> {
        let d = draws.first()?.len();
        let numbers = 1 + d + d * (d + 1) / 2;
        let most = (draws.len() / (PER_NUMBER * numbers)).clamp(1, MOST);
        let mut best: Option<(f64, Self)> = None;
        let mut worse = 0;
        for count in 1..=most {
            let starts = if count == 1 { 1 } else { STARTS };
            let fits = (0..starts)
                .filter_map(|start| Self::climb(draws, count, &stream.at(count as u64).at(start)));
            let scored = fits.map(|fit| (fit.mean_log_density(others), fit));
            let Some(one) = scored.max_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
            if best.as_ref().is_none_or(|(value, _)| one.0 > *value) {
                (best, worse) = (Some(one), 0);
            } else {
                worse += 1;
            }
            if worse == 3 {
                break;
            }
        }
        best.map(|(_, fit)| fit)
    }

    /// Number of components.
    pub fn count(&self) -> usize {
        self.components.len()
    }

    /// Mean log density of draws.
    pub fn mean_log_density(&self, draws: &[Vec<f64>]) -> f64 {
        let mut logs = Logs::of(self);
        let log_density = |z: &Vec<f64>| log_sum(logs.at(z).iter().copied());
        draws.iter().map(log_density).sum::<f64>() / draws.len() as f64
    }

    /// Log density at a point.
    pub fn log_density(&self, z: &[f64]) -> f64 {
        log_sum(self.logs(z).iter().copied())
    }

    fn logs(&self, z: &[f64]) -> Vec<f64> {
        Logs::of(self).at(z).to_vec()
    }

    /// Derivatives of the log density.
    pub(super) fn slopes(&self, z: &[f64]) -> Vec<f64> {
        let logs = self.logs(z);
        let whole = log_sum(logs.iter().copied());
        let mut slopes = vec![0.0; z.len()];
        for (component, log) in self.components.iter().zip(&logs) {
            let share = (log - whole).exp();
            for (slope, own) in slopes.iter_mut().zip(component.slopes(z)) {
                *slope += share * own;
            }
        }
        slopes
    }

    /// A draw.
    pub fn sample(&self, rng: &mut impl Rng) -> Vec<f64> {
        let mut left = uniform(rng);
        let last = self.components.len() - 1;
        let found = self.components[..last].iter().position(|c| {
            left -= c.weight;
            left < 0.0
        });
        let component = &self.components[found.unwrap_or(last)];
        let white: Vec<f64> = component.mean.iter().map(|_| normal(rng)).collect();
        let coloured = component
            .factor
            .iter()
            .map(|row| row.iter().zip(&white).map(|(a, b)| a * b).sum::<f64>());
        coloured.zip(&component.mean).map(|(x, m)| x + m).collect()
    }

    /// Expectation and maximisation from random centres.
    fn climb(draws: &[Vec<f64>], count: usize, stream: &Stream) -> Option<Self> {
        let mut mixture = Self::start(draws, count, stream)?;
        let mut before = f64::NEG_INFINITY;
        for _ in 0..STEPS {
            let mut logs = Logs::of(&mixture);
            let mut shares = Matrix::zeros(0, mixture.count());
            let mut value = 0.0;
            for z in draws {
                let logs = logs.at(z);
                let whole = log_sum(logs.iter().copied());
                value += whole;
                shares.extend_row(logs.iter().map(|log| (log - whole).exp()));
            }
            value /= draws.len() as f64;
            if !value.is_finite() {
                return None;
            }
            if value - before < GAIN {
                break;
            }
            before = value;
            mixture = Self::maximised(draws, &shares)?;
        }
        Some(mixture)
    }

    /// Components about centres that are far from each other (Arthur and Vassilvitskii, SODA 2007), with the draws nearest.
    fn start(draws: &[Vec<f64>], count: usize, stream: &Stream) -> Option<Self> {
        let mut rng = stream.generator();
        let distance =
            |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum() };
        let pick = |rng: &mut rand::rngs::ChaCha8Rng| {
            ((uniform(rng) * draws.len() as f64) as usize).min(draws.len() - 1)
        };
        let mut centres = vec![&draws[pick(&mut rng)]];
        while centres.len() < count {
            let near: Vec<f64> = draws
                .iter()
                .map(|z| centres.iter().map(|c| distance(z, c)).fold(f64::INFINITY, f64::min))
                .collect();
            let mut left = uniform(&mut rng) * near.iter().sum::<f64>();
            let chosen = near.iter().position(|near| {
                left -= near;
                left < 0.0
            });
            centres.push(&draws[chosen.unwrap_or(0)]);
        }
        let mut shares = Matrix::zeros(0, count);
        for z in draws {
            let near = centres.iter().map(|c| distance(z, c));
            let nearest = near.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(k, _)| k);
            shares.extend_row((0..count).map(|k| f64::from(u8::from(k == nearest))));
        }
        Self::maximised(draws, &shares)
    }

    fn maximised(draws: &[Vec<f64>], shares: &Matrix) -> Option<Self> {
        let d = draws[0].len();
        let component = |k: usize| {
            let sum: f64 = shares.iter_rows().map(|share| share[k]).sum();
            // A component with fewer draws than it has directions is dropped.
            if sum < (d + 1) as f64 {
                return None;
            }
            let mut mean = vec![0.0; d];
            for (z, share) in draws.iter().zip(shares.iter_rows()) {
                mean.iter_mut().zip(z).for_each(|(m, z)| *m += share[k] * z / sum);
            }
            let mut covariance = vec![vec![0.0; d]; d];
            for (z, share) in draws.iter().zip(shares.iter_rows()) {
                for i in 0..d {
                    let scaled = share[k] * (z[i] - mean[i]) / sum;
                    for j in 0..=i {
                        covariance[i][j] += scaled * (z[j] - mean[j]);
                    }
                }
            }
            (0..d).for_each(|i| covariance[i][i] += RIDGE);
            let factor = cholesky(&covariance)?;
            Some(Component { weight: sum / draws.len() as f64, mean, factor })
        };
        let mut components: Vec<Component> = (0..shares.columns()).filter_map(component).collect();
        let sum: f64 = components.iter().map(|c| c.weight).sum();
        for component in &mut components {
            component.weight /= sum;
        }
        (!components.is_empty()).then_some(Self { components })
    }
}

/// Logarithms of the weighted densities of the components, at many points.
struct Logs<'a> {
    mixture: &'a Mixture,
    /// Logarithms of weight and of the factor's determinant, by component.
    constants: Vec<(f64, f64)>,
    white: Vec<f64>,
    values: Vec<f64>,
}

impl<'a> Logs<'a> {
    fn of(mixture: &'a Mixture) -> Self {
        let constants = |c: &Component| {
            let log_factor: f64 = c.factor.iter().enumerate().map(|(i, row)| row[i].ln()).sum();
            (c.weight.ln(), log_factor)
        };
        Self {
            mixture,
            constants: mixture.components.iter().map(constants).collect(),
            white: Vec::new(),
            values: Vec::new(),
        }
    }

    fn at(&mut self, z: &[f64]) -> &[f64] {
        let Self { mixture, constants, white, values } = self;
        values.clear();
        for (component, (log_weight, log_factor)) in mixture.components.iter().zip(constants) {
            component.whiten(z, white);
            let square: f64 = white.iter().map(|w| w * w).sum();
            let log_density = -0.5 * square - *log_factor - z.len() as f64 * HALF_LN_TWO_PI;
            values.push(*log_weight + log_density);
        }
        values
    }
}

impl Component {
    fn white(&self, z: &[f64]) -> Vec<f64> {
        let mut x = Vec::new();
        self.whiten(z, &mut x);
        x
    }

    fn whiten(&self, z: &[f64], x: &mut Vec<f64>) {
        x.clear();
        for (i, row) in self.factor.iter().enumerate() {
            let before: f64 = row.iter().zip(&*x).map(|(a, b)| a * b).sum();
            x.push((z[i] - self.mean[i] - before) / row[i]);
        }
    }

    fn slopes(&self, z: &[f64]) -> Vec<f64> {
        let n = z.len();
        let mut x = self.white(z);
        for i in (0..n).rev() {
            let above: f64 = (i + 1..n).map(|k| self.factor[k][i] * x[k]).sum();
            x[i] = (x[i] - above) / self.factor[i][i];
        }
        x.iter().map(|x| -x).collect()
    }
}

fn cholesky(rows: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let mut factor: Vec<Vec<f64>> = Vec::new();
    for (i, row) in rows.iter().enumerate() {
        let mut own: Vec<f64> = Vec::new();
        for j in 0..i {
            let product: f64 = own.iter().zip(&factor[j]).map(|(a, b)| a * b).sum();
            own.push((row[j] - product) / factor[j][j]);
        }
        let rest = row[i] - own.iter().map(|a| a * a).sum::<f64>();
        if rest.is_nan() || rest <= 0.0 {
            return None;
        }
        own.push(rest.sqrt());
        factor.push(own);
    }
    Some(factor)
}

#[cfg(test)]
mod tests;
