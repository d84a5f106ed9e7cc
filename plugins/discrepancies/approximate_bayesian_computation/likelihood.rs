//! The likelihood of approximate Bayesian computation, with fixed random numbers.

use lacuna::data::{Measurements, Replicate};
use lacuna::math::random::{Stream, below, normal};
use lacuna::plugin::Fact;
use lacuna::plugin::discrepancy::{
    CommonError, ErrorPath, Hyperparameter, Likelihood, VariancePart,
};
use lacuna_linalg::Matrix;

use super::metric::ToData;
use crate::discrepancies::common::{Noise, PerGroup, Replicates, part};

/// The points that are compared with each other.
pub(super) struct Set {
    /// Output of each point.
    pub outputs: Vec<usize>,
    pub to_data: ToData,
    /// Output of each point of each simulated data set, `simulations x points`: another order than that of the data if
    /// the response is a sample.
    pub drawn: Vec<Vec<usize>>,
    /// Standard normal noise, `simulations x points`.
    pub noise: Matrix,
}

impl Set {
    /// Draws the random numbers of all simulated data sets.
    pub fn new(
        outputs: Vec<usize>,
        to_data: ToData,
        (simulations, sample): (usize, bool),
        stream: &Stream,
    ) -> Self {
        let draw = |m: usize| {
            let mut rng = stream.named("output").at(m as u64).generator();
            let any = |_: &usize| outputs[below(&mut rng, outputs.len())];
            if sample { outputs.iter().map(any).collect() } else { outputs.clone() }
        };
        let drawn = (0..simulations).map(draw).collect();
        let mut rng = stream.named("noise").generator();
        let noise = Matrix::from_fn(simulations, outputs.len(), |_, _| normal(&mut rng));
        Self { outputs, to_data, drawn, noise }
    }
}

/// The likelihood: the mean of `Π exp(-d² / (2 ε²)) / ε` over simulated data sets, the product over sets of points.
pub(super) struct Approximate {
    pub noise: Noise,
    pub replicates: Replicates,
    pub hyper: Vec<Hyperparameter>,
    pub tolerance: PerGroup,
    pub sets: Vec<Set>,
    /// Common errors of each simulated data set, `simulations x outputs`.
    pub common: Matrix,
    /// True if the response is a sample, in no order.
    pub sample: bool,
}

/// One draw of all common errors for each of so many data sets, `simulations x outputs`.
pub(super) fn common_draws(
    errors: &[CommonError],
    (simulations, outputs): (usize, usize),
    stream: &Stream,
) -> Matrix {
    let zero = vec![0.0; outputs];
    let one = |m: usize| CommonError::added(errors, &zero, &stream.at(m as u64));
    let rows: Vec<Vec<f64>> = (0..simulations).map(one).collect();
    Matrix::from_fn(simulations, outputs, |m, i| rows[m][i])
}

/// The likelihood at one point, with what its derivatives need.
struct Solved {
    log_likelihood: f64,
    sd: Vec<f64>,
    tolerance: Vec<f64>,
    /// Weight of each simulated data set.
    weights: Vec<f64>,
    /// Squared distances, `simulations x sets`.
    squares: Matrix,
}

impl Approximate {
    fn simulated(&self, set: &Set, m: usize, response: &[f64], sd: &[f64]) -> Vec<f64> {
        let noise = set.drawn[m].iter().zip(set.noise.row(m));
        noise.map(|(&i, z)| response[i] + self.common[(m, i)] + sd[i] * z).collect()
    }

    fn solve(&self, response: &[f64], hyper: &[f64]) -> Option<Solved> {
        let tolerance = self.tolerance.values(hyper)?.to_vec();
        let variance = self.noise.by_output(self.noise.variance.values(hyper)?);
        let sd: Vec<f64> = variance.iter().map(|v| v.sqrt()).collect();
        let squares = Matrix::from_fn(self.common.rows(), self.sets.len(), |m, g| {
            let set = &self.sets[g];
            set.to_data.square(&self.simulated(set, m, response, &sd), None)
        });
        let log_kernel = |row: &[f64]| -> f64 {
            let of = |(square, e): (&f64, &f64)| LN_HALF_NORMAL - e.ln() - 0.5 * square / (e * e);
            row.iter().zip(&tolerance).map(of).sum()
        };
        let logs: Vec<f64> = squares.iter_rows().map(log_kernel).collect();
        let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mut weights: Vec<f64> = logs.iter().map(|l| (l - largest).exp()).collect();
        let sum: f64 = weights.iter().sum();
        for weight in &mut weights {
            *weight /= sum;
        }
        let log_likelihood = largest + (sum / logs.len() as f64).ln();
        log_likelihood.is_finite().then_some(Solved {
            log_likelihood,
            sd,
            tolerance,
            weights,
            squares,
        })
    }

    /// Variance of each output of a new replicate about the response, without common errors: the noise, and for a
    /// sample the scatter of its values.
    fn variance(&self, response: &[f64], hyper: &[f64]) -> Vec<f64> {
        let Some(groups) = self.noise.variance.values(hyper) else {
            return vec![f64::NAN; response.len()];
        };
        let mut variance = self.noise.by_output(groups);
        if self.sample {
            for (i, v) in variance.iter_mut().enumerate() {
                let Some(set) = self.set_of(i) else { continue };
                let squares = set.outputs.iter().map(|&j| (response[j] - response[i]).powi(2));
                *v += squares.sum::<f64>() / set.outputs.len() as f64;
            }
        }
        variance
    }

    /// The points among which the output lies.
    fn set_of(&self, output: usize) -> Option<&Set> {
        self.sets.iter().find(|set| set.outputs.contains(&output))
    }

    /// One replicate about a mean: noise, and for a sample a random member of it in each place.
    fn replicate(&self, mean: &[f64], hyper: &[f64], stream: &Stream) -> Vec<f64> {
        let groups = self.noise.variance.values(hyper).unwrap_or_default();
        let variance = self.noise.by_output(groups);
        let (mut rng, mut members) = (stream.generator(), stream.named("member").generator());
        let one = |(i, y): (usize, &f64)| {
            let own = match self.set_of(i).filter(|_| self.sample) {
                None => *y,
                Some(set) => mean[set.outputs[below(&mut members, set.outputs.len())]],
            };
            own + variance[i].sqrt() * normal(&mut rng)
        };
        mean.iter().enumerate().map(one).collect()
    }
}

/// `ln √(2/π)`: the kernel is a half-normal density of the distance.
const LN_HALF_NORMAL: f64 = -0.225_791_352_644_727_43;

impl Likelihood for Approximate {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        self.solve(response, hyper).map_or(f64::NEG_INFINITY, |solved| solved.log_likelihood)
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut by_response, mut by_hyper) = (vec![0.0; response.len()], vec![0.0; hyper.len()]);
        let Some(solved) = self.solve(response, hyper) else { return (by_response, by_hyper) };
        let mut by_variance = vec![0.0; response.len()];
        let mut by_tolerance = vec![0.0; self.sets.len()];
        for (g, set) in self.sets.iter().enumerate() {
            let e = solved.tolerance[g];
            let mut slopes = vec![0.0; set.outputs.len()];
            for (m, weight) in solved.weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
                by_tolerance[g] += weight * (solved.squares[(m, g)] / (e * e) - 1.0) / e;
                let values = self.simulated(set, m, response, &solved.sd);
                set.to_data.square(&values, Some(&mut slopes));
                for ((&i, z), slope) in set.drawn[m].iter().zip(set.noise.row(m)).zip(&slopes) {
                    let by = -0.5 * weight * slope / (e * e);
                    by_response[i] += by;
                    by_variance[i] += by * z / (2.0 * solved.sd[i]);
                }
            }
        }
        let of_measured: Vec<f64> =
            self.replicates.measured.iter().map(|&i| by_variance[i]).collect();
        let by_group = self.noise.by_group(&self.replicates, &of_measured);
        self.noise.variance.add_gradient(&by_group, &mut by_hyper);
        self.tolerance.add_gradient(&by_tolerance, &mut by_hyper);
        (by_response, by_hyper)
    }

    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        let own = part("measurement", self.variance(response, hyper));
        std::iter::once(own).chain(self.noise.setting.common_parts()).collect()
    }

    fn errors(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        let made = self.replicate(response, hyper, &stream.at(0));
        let values = made.iter().zip(response).map(|(y, mean)| y - mean).collect();
        let own = ErrorPath { origin: "measurement".into(), values };
        std::iter::once(own).chain(self.noise.setting.drawn_common_errors(stream)).collect()
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let common = self.noise.setting.with_common_errors(&vec![0.0; response.len()], stream);
        let mut made = self.noise.setting.data.clone();
        let fill = |(r, replicate): (usize, &mut Replicate)| {
            let own = self.replicate(response, hyper, &stream.named("replicate").at(r as u64));
            for ((value, y), e) in replicate.values.iter_mut().zip(own).zip(&common) {
                *value = value.map(|_| y + e);
            }
        };
        made.replicates.iter_mut().enumerate().for_each(fill);
        vec![made]
    }

    fn facts(&self) -> Vec<Fact> {
        let points: usize = self.sets.iter().map(|set| set.outputs.len()).sum();
        vec![
            Fact::new("data", points),
            Fact::new("distances", self.sets.len()),
            Fact::new("simulated data sets", self.common.rows()),
        ]
    }
}
