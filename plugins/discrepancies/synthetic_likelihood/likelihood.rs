//! The synthetic likelihood of all replicates.

use lacuna::data::Measurements;
use lacuna::math::random::{Stream, normal as standard_normal};
use lacuna::plugin::Fact;
use lacuna::plugin::discrepancy::{ErrorPath, Hyperparameter, Likelihood, VariancePart};
use lacuna_linalg::Matrix;

use super::Estimator;
use super::normal::log_density;
use crate::discrepancies::common::{Noise, Normal, Replicates, part};

/// Noise of the measurement that the model does not contain.
pub(super) struct Noisy {
    pub noise: Noise,
    /// Normal likelihood of one response that all replicates share.
    pub normal: Normal,
    pub replicates: Replicates,
}

impl Noisy {
    fn measured(&self, hyper: &[f64]) -> Option<Vec<f64>> {
        let groups = self.noise.variance.values(hyper)?;
        Some(self.noise.by_measured(&self.replicates, groups))
    }
}

/// The likelihood; see the module of the discrepancy.
pub(super) struct Synthetic {
    pub noisy: Option<Noisy>,
    pub hyper: Vec<Hyperparameter>,
    /// Output and value of the data of each replicate.
    pub data: Vec<Vec<(usize, f64)>>,
    pub measured: Measurements,
    /// Runs of the model for each replicate.
    pub simulations: usize,
    pub estimator: Estimator,
}

impl Synthetic {
    /// Variance of the noise of each output; zero without noise.
    fn variance(&self, hyper: &[f64]) -> Vec<f64> {
        let outputs = self.measured.layout.len();
        let Some(noisy) = &self.noisy else { return vec![0.0; outputs] };
        let groups = noisy.noise.variance.values(hyper);
        groups.map_or_else(|| vec![f64::NAN; outputs], |groups| noisy.noise.by_output(groups))
    }

    /// Simulated data at the outputs of a replicate: a run with its noise.
    fn simulated(&self, run: &[f64], data: &[(usize, f64)], sd: &[f64]) -> Vec<f64> {
        if self.noisy.is_none() {
            return data.iter().map(|&(output, _)| run[output]).collect();
        }
        // Random numbers that belong to the run: the same run has the same noise, and every other run has another.
        let own = Stream::root(0).named("noise");
        let mut rng = run.iter().fold(own, |stream, y| stream.at(y.to_bits())).generator();
        let noise: Vec<f64> = run.iter().map(|_| standard_normal(&mut rng)).collect();
        data.iter().map(|&(output, _)| run[output] + sd[output] * noise[output]).collect()
    }
}

impl Likelihood for Synthetic {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn runs(&self) -> usize {
        self.simulations * self.data.len()
    }

    fn log_estimate(&self, runs: &Matrix, hyper: &[f64]) -> f64 {
        let sd: Vec<f64> = self.variance(hyper).iter().map(|v| v.sqrt()).collect();
        if sd.iter().any(|sd| sd.is_nan()) {
            return f64::NEG_INFINITY;
        }
        let rows: Vec<&[f64]> = runs.iter_rows().collect();
        let of_replicate = |(data, own): (&Vec<(usize, f64)>, &[&[f64]])| {
            // A normal distribution of runs some of which have no response is not known.
            if own.iter().any(|run| run.iter().any(|y| !y.is_finite())) {
                return f64::NEG_INFINITY;
            }
            let sample: Vec<Vec<f64>> =
                own.iter().map(|run| self.simulated(run, data, &sd)).collect();
            let point: Vec<f64> = data.iter().map(|&(_, value)| value).collect();
            log_density(&point, &sample, self.estimator)
        };
        self.data.iter().zip(rows.chunks(self.simulations)).map(of_replicate).sum()
    }

    /// The density of the noise about one response; zero if the model contains all noise.
    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        let Some(noisy) = &self.noisy else { return f64::NEG_INFINITY };
        let solved = noisy.measured(hyper).and_then(|v| noisy.normal.solve(response, &v));
        solved.map(|s| s.log_likelihood).filter(|l| !l.is_nan()).unwrap_or(f64::NEG_INFINITY)
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let nothing = || (vec![0.0; response.len()], vec![0.0; hyper.len()]);
        let Some(noisy) = &self.noisy else { return nothing() };
        let Some(variance) = noisy.measured(hyper) else { return nothing() };
        let Some(solved) = noisy.normal.solve(response, &variance) else { return nothing() };
        let by_response = noisy.normal.by_response(&solved, &variance);
        let by_variance = noisy.normal.by_variance(&solved, &variance);
        let mut by_hyper = vec![0.0; hyper.len()];
        let by_group = noisy.noise.by_group(&noisy.replicates, &by_variance);
        noisy.noise.variance.add_gradient(&by_group, &mut by_hyper);
        (noisy.replicates.over_all(&by_response, response.len()), by_hyper)
    }

    fn predictive(&self, _response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        let own = part("measurement", self.variance(hyper));
        let common = self.noisy.iter().flat_map(|noisy| noisy.noise.setting.common_parts());
        std::iter::once(own).chain(common).collect()
    }

    fn errors(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        let own = self.predictive(response, hyper)[0].independent(&stream.at(0));
        let mut all = vec![own];
        if let Some(noisy) = &self.noisy {
            all.extend(noisy.noise.setting.drawn_common_errors(stream));
        }
        all
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        if let Some(noisy) = &self.noisy {
            return vec![noisy.noise.setting.simulate(response, &self.variance(hyper), stream)];
        }
        let mut made = self.measured.clone();
        for replicate in &mut made.replicates {
            let all = replicate.values.iter_mut().zip(response);
            all.for_each(|(value, y)| *value = value.map(|_| *y));
        }
        vec![made]
    }

    fn facts(&self) -> Vec<Fact> {
        let values: usize = self.data.iter().map(Vec::len).sum();
        vec![Fact::new("data", values), Fact::new("runs for each replicate", self.simulations)]
    }
}
