//! `shot_noise`: counting noise.

use std::f64::consts::TAU;

use lacuna::data::Measurements;
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::{CommonError, Known, VariancePart};
use lacuna::plugin::{Component, Context, Discrepancy, Hyperparameter, Likelihood};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Shot noise: normal noise whose variance grows with the response, as for counted photons, ions or pulses.
///
/// ```text
/// variance = gain · (response + background)
/// ```
///
/// The gain, the reading per count, is unknown. Below about twenty counts the distribution is not normal, and if the
/// noise does not vanish with the signal, `multiplicative_gaussian` with its floor is better.
///
/// Reference: Janesick, Photon Transfer (2007), chapter 5.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShotNoise {
    /// Prior of the gain, in the unit of the response, such as `{ half_normal = 2 }`.
    pub gain: Distribution,
    /// Background that is counted and then subtracted from the reading, such as dark counts, in the unit of the
    /// response.
    #[serde(default)]
    pub background: f64,
}

impl Component for ShotNoise {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if self.gain.support().0 < 0.0 {
            complaints
                .at("gain")
                .say("a variance is not below zero")
                .expected("a prior of positive numbers, such as `{ half_normal = 2 }`")
                .found(&self.gain);
        }
        if !(self.background >= 0.0 && self.background.is_finite()) {
            complaints
                .at("background")
                .say("nothing is counted less than never")
                .expected("a number from 0")
                .found(self.background);
        }
    }
}

impl Discrepancy for ShotNoise {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        let outputs = known.data.layout.len();
        let sound = |values: &[Option<f64>]| {
            values.len() == outputs && values.iter().flatten().all(|y| y.is_finite())
        };
        if let Some(bad) = known.data.replicates.iter().find(|r| !sound(&r.values)) {
            let name = &bad.name;
            return Err(Stop::new(format!("replicate `{name}` has not {outputs} finite values")));
        }
        if let Some(bad) = known.common.iter().find(|e| e.factor.rows() != outputs) {
            let origin = &bad.origin;
            return Err(Stop::new(format!("the error `{origin}` has not {outputs} outputs")));
        }
        let summaries = known.data.summaries();
        let measured: Vec<usize> = (0..outputs).filter(|&i| summaries[i].count > 0).collect();
        if measured.is_empty() {
            return Err(Stop::new("the measurements hold no value"));
        }
        let of = |i: usize| known.common.iter().flat_map(move |e| e.factor.row(i)).copied();
        let rank = known.common.iter().map(|e| e.factor.columns()).sum();
        Ok(Box::new(Counts {
            unknown: [Hyperparameter {
                name: "gain".into(),
                symbol: "g".into(),
                unit: known.data.layout.unit.clone(),
                log: true,
                start: self.gain.quantile(0.5),
                prior: self.gain.clone(),
            }],
            background: self.background,
            data: known.data.clone(),
            common: known.common.to_vec(),
            count: measured.iter().map(|&i| summaries[i].count as f64).collect(),
            mean: measured.iter().map(|&i| summaries[i].mean).collect(),
            scatter: measured.iter().map(|&i| summaries[i].scatter).collect(),
            factor: Matrix::from_rows(rank, (0..outputs).map(|i| of(i).collect::<Vec<_>>())),
            measured,
        }))
    }
}

/// The likelihood as a function of counts `n`, means and scatters `S` of the measured outputs. With the variances `v`,
/// the common errors `F z`, `z` standard normal, and `e = mean - response - F z`,
///
/// ```text
/// -2 log L = Σ [n log(2 pi v) + (S + n e²) / v] + |z|² + log det C,   C = I + F' (n/v) F
/// ```
///
/// at `z = C⁻¹ F' (n/v) (mean - response)`: Woodbury's identity, without its cancellation.
struct Counts {
    unknown: [Hyperparameter; 1],
    background: f64,
    data: Measurements,
    common: Vec<CommonError>,
    measured: Vec<usize>,
    count: Vec<f64>,
    mean: Vec<f64>,
    scatter: Vec<f64>,
    /// Factors of all common errors side by side, for all outputs.
    factor: Matrix,
}

/// Parts of the likelihood at one response and one gain, by measured output.
struct Solved {
    log_likelihood: f64,
    variance: Vec<f64>,
    error: Vec<f64>,
    /// `f' C⁻¹ f`: the posterior variance of the common error of the output.
    spread: Vec<f64>,
}

impl Counts {
    fn variance(&self, y: f64, gain: f64) -> f64 {
        gain * (y + self.background)
    }

    /// The parts of the likelihood; `None` if a variance would not be positive, where the likelihood is zero.
    fn solve(&self, response: &[f64], gain: f64) -> Option<Solved> {
        let own = self.factor.select_rows(&self.measured);
        let variance: Vec<f64> =
            self.measured.iter().map(|&i| self.variance(response[i], gain)).collect();
        if !(gain > 0.0 && variance.iter().all(|v| *v > 0.0 && v.is_finite())) {
            return None;
        }
        let weight: Vec<f64> = self.count.iter().zip(&variance).map(|(n, v)| n / v).collect();
        let scaled =
            Matrix::from_fn(own.rows(), own.columns(), |k, j| weight[k].sqrt() * own[(k, j)]);
        let mut capacitance = lacuna_linalg::gram(&scaled);
        (0..own.columns()).for_each(|j| capacitance[(j, j)] += 1.0);
        let capacitance = Cholesky::new(&capacitance).ok()?;
        let residual = self.measured.iter().zip(&self.mean).map(|(&i, mean)| mean - response[i]);
        let mut error: Vec<f64> = residual.collect();
        let pull: Vec<f64> = error.iter().zip(&weight).map(|(e, w)| w * e).collect();
        let mut z = lacuna_linalg::transposed_multiply_vector(&own, &pull);
        capacitance.solve(&mut z);
        let (mut spread, mut twice) = (Vec::new(), dot(&z, &z) + capacitance.log_determinant());
        for (k, f) in own.iter_rows().enumerate() {
            error[k] -= dot(f, &z);
            let (n, v) = (self.count[k], variance[k]);
            twice += n * (TAU * v).ln() + (self.scatter[k] + n * error[k] * error[k]) / v;
            spread.push(capacitance.quadratic(f));
        }
        Some(Solved { log_likelihood: -0.5 * twice, variance, error, spread })
    }
}

impl Likelihood for Counts {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.unknown
    }

    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        self.solve(response, hyper[0]).map_or(f64::NEG_INFINITY, |solved| solved.log_likelihood)
    }

    /// The response enters both the mean and the variance.
    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut by_response, mut by_gain) = (vec![0.0; response.len()], 0.0);
        let Some(solved) = self.solve(response, hyper[0]) else {
            return (by_response, vec![by_gain]);
        };
        for (k, &i) in self.measured.iter().enumerate() {
            let (n, v, e) = (self.count[k], solved.variance[k], solved.error[k]);
            let squares = self.scatter[k] + n * (e * e + solved.spread[k]);
            let by_variance = -0.5 * (n - squares / v) / v;
            by_response[i] = n * e / v + by_variance * hyper[0];
            by_gain += by_variance * (response[i] + self.background);
        }
        (by_response, vec![by_gain])
    }

    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        let own = response.iter().map(|y| self.variance(*y, hyper[0]).max(0.0)).collect();
        let common = self.common.iter().filter(|error| error.predictive).map(|error| {
            let variance = error.factor.iter_rows().map(|f| dot(f, f)).collect();
            VariancePart { origin: error.origin.clone(), variance }
        });
        let own = VariancePart { origin: "measurement".into(), variance: own };
        std::iter::once(own).chain(common).collect()
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let mut rng = stream.named("common").generator();
        let z: Vec<f64> = (0..self.factor.columns()).map(|_| normal(&mut rng)).collect();
        let mut made = self.data.clone();
        for (r, replicate) in made.replicates.iter_mut().enumerate() {
            let mut rng = stream.named("replicate").at(r as u64).generator();
            for (i, value) in replicate.values.iter_mut().enumerate() {
                let sd = self.variance(response[i], hyper[0]).max(0.0).sqrt();
                let drawn = response[i] + dot(self.factor.row(i), &z) + sd * normal(&mut rng);
                *value = value.map(|_| drawn);
            }
        }
        vec![made]
    }
}

lacuna::register!(Discrepancy, "shot_noise", ShotNoise);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_keeps_the_contract() {
        let plugin = ShotNoise { gain: Distribution::HalfNormal(0.1), background: 0.01 };
        assert_eq!(lacuna_contract::discrepancy("shot_noise", &plugin), Ok(()));
    }
}
