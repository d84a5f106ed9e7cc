//! The estimate of the likelihood from runs of the model, and the likelihood of one response.

use std::f64::consts::TAU;

use lacuna::data::Measurements;
use lacuna::math::random::Stream;
use lacuna::plugin::Fact;
use lacuna::plugin::discrepancy::{ErrorPath, Hyperparameter, Likelihood, VariancePart};
use lacuna_linalg::Matrix;

use crate::discrepancies::common::{Noise, Normal, Replicates, part};

/// A measured value.
#[derive(Debug, Clone, Copy)]
pub(super) struct Datum {
    pub output: usize,
    pub value: f64,
}

/// The likelihood; see the module of the discrepancy.
pub(super) struct Estimated {
    pub noise: Noise,
    /// Normal likelihood of one response that all replicates share.
    pub normal: Normal,
    pub replicates: Replicates,
    pub hyper: Vec<Hyperparameter>,
    /// Data of each replicate, by groups that are independent of each other.
    pub data: Vec<Vec<Vec<Datum>>>,
    /// Runs of the model for each replicate.
    pub simulations: usize,
}

impl Estimated {
    fn variance(&self, hyper: &[f64]) -> Vec<f64> {
        let groups = self.noise.variance.values(hyper);
        let outputs = self.noise.groups.of.len();
        groups.map_or_else(|| vec![f64::NAN; outputs], |groups| self.noise.by_output(groups))
    }

    fn measured(&self, hyper: &[f64]) -> Option<Vec<f64>> {
        let groups = self.noise.variance.values(hyper)?;
        Some(self.noise.by_measured(&self.replicates, groups))
    }
}

/// Log of the mean over runs of the density of some data, with these variances of the outputs.
fn log_mean(data: &[Datum], runs: &[&[f64]], variance: &[f64]) -> f64 {
    let constant: f64 = data.iter().map(|datum| (TAU * variance[datum.output]).ln()).sum();
    let misfit = |run: &&[f64]| -> f64 {
        let square =
            |datum: &Datum| (datum.value - run[datum.output]).powi(2) / variance[datum.output];
        let sum: f64 = data.iter().map(square).sum();
        // A run without a response contributes nothing.
        if sum.is_nan() { f64::INFINITY } else { sum }
    };
    let misfits: Vec<f64> = runs.iter().map(misfit).collect();
    let least = misfits.iter().copied().fold(f64::INFINITY, f64::min);
    if least.is_infinite() {
        return f64::NEG_INFINITY;
    }
    let sum: f64 = misfits.iter().map(|misfit| (-0.5 * (misfit - least)).exp()).sum();
    (sum / runs.len() as f64).ln() - 0.5 * (least + constant)
}

impl Likelihood for Estimated {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn runs(&self) -> usize {
        self.simulations * self.data.len()
    }

    fn log_estimate(&self, runs: &Matrix, hyper: &[f64]) -> f64 {
        let variance = self.variance(hyper);
        if variance.iter().any(|v| v.is_nan()) {
            return f64::NEG_INFINITY;
        }
        let rows: Vec<&[f64]> = runs.iter_rows().collect();
        let each = self.data.iter().zip(rows.chunks(self.simulations));
        let of_replicate = |(groups, own): (&Vec<Vec<Datum>>, &[&[f64]])| -> f64 {
            groups.iter().map(|data| log_mean(data, own, &variance)).sum()
        };
        each.map(of_replicate).sum()
    }

    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        let solved = self.measured(hyper).and_then(|v| self.normal.solve(response, &v));
        solved.map(|s| s.log_likelihood).filter(|l| !l.is_nan()).unwrap_or(f64::NEG_INFINITY)
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let nothing = || (vec![0.0; response.len()], vec![0.0; hyper.len()]);
        let Some(variance) = self.measured(hyper) else { return nothing() };
        let Some(solved) = self.normal.solve(response, &variance) else { return nothing() };
        let by_response = self.normal.by_response(&solved, &variance);
        let by_variance = self.normal.by_variance(&solved, &variance);
        let mut by_hyper = vec![0.0; hyper.len()];
        let by_group = self.noise.by_group(&self.replicates, &by_variance);
        self.noise.variance.add_gradient(&by_group, &mut by_hyper);
        (self.replicates.over_all(&by_response, response.len()), by_hyper)
    }

    fn predictive(&self, _response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        let own = part("measurement", self.variance(hyper));
        std::iter::once(own).chain(self.noise.setting.common_parts()).collect()
    }

    fn errors(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        let own = self.predictive(response, hyper)[0].independent(&stream.at(0));
        std::iter::once(own).chain(self.noise.setting.drawn_common_errors(stream)).collect()
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        vec![self.noise.setting.simulate(response, &self.variance(hyper), stream)]
    }

    fn facts(&self) -> Vec<Fact> {
        let values: usize = self.data.iter().flatten().map(Vec::len).sum();
        vec![Fact::new("data", values), Fact::new("runs for each replicate", self.simulations)]
    }
}
