//! The tests of equality of a drift map, with a simulated null distribution.

use lacuna::data::Parameter;
use lacuna::math::random::Stream;
use lacuna_linalg::Matrix;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::equality::{Equality, EqualityTests, WindowSlopes};
use crate::gap::experiment::Experiment;
use crate::gap::noise::{Noise, ResponseTangents};
use crate::gap::system::whitener::Whitener;
use crate::gap::test::{common_error, probability};

/// The data of a drift map.
pub(super) struct DriftSetting<'a> {
    pub experiment: &'a Experiment<'a>,
    pub noise: &'a Noise,
    pub response: &'a [f64],
    /// Residuals of the means against the response, one per output.
    pub misfit: &'a [f64],
    /// The slopes of the windows, and of all unknowns, in units of the standard deviations of the priors.
    pub pieces: &'a Matrix,
    pub common: &'a Matrix,
    pub parameters: usize,
    /// The windows of each condition.
    pub conditions: &'a [Vec<usize>],
    pub simulations: usize,
    pub stream: &'a Stream,
}

impl DriftSetting<'_> {
    fn whitened(&self, whitener: &Whitener) -> Option<WindowSlopes> {
        let slopes = whitener.whiten_rows(self.pieces);
        WindowSlopes::new(slopes, &whitener.whiten_rows(self.common), self.parameters)
    }

    /// The tests, with a simulated null distribution if the options ask for simulations.
    pub fn tests(&self, whitener: &Whitener) -> Option<(WindowSlopes, EqualityTests)> {
        let pieces = self.whitened(whitener)?;
        let mut tests = pieces.tests(&whitener.whiten(self.misfit), self.conditions)?;
        if self.simulations > 0 {
            let simulated: Vec<Option<Vec<f64>>> = (0..self.simulations)
                .into_par_iter()
                .map(|b| self.simulated(&self.stream.at(b as u64)))
                .collect();
            let simulated: Vec<Vec<f64>> = simulated.into_iter().flatten().collect();
            for (k, test) in tests.each().into_iter().enumerate() {
                let null: Vec<f64> = simulated.iter().map(|each| each[k]).collect();
                if test.freedom > 0 {
                    test.p = probability(&null, test.standardised());
                }
            }
        }
        Some((pieces, tests))
    }

    fn simulated(&self, stream: &Stream) -> Option<Vec<f64>> {
        let replicates = self.noise.simulate(self.experiment, self.response, stream);
        let simulated = self.experiment.with_replicates(replicates);
        let error = common_error(self.experiment, self.noise, &stream.named("common"));
        let (_, means) = simulated.means();
        let around =
            ResponseTangents { response: self.response.to_vec(), slopes: self.common.clone() };
        let noise = Noise::of(&simulated, &around, Some(self.noise));
        let whitener = Whitener::new(&simulated, &noise, self.response);
        let misfit: Vec<f64> =
            (0..means.len()).map(|i| means[i] - self.response[i] + error[i]).collect();
        let pieces = self.whitened(&whitener)?;
        let mut tests = pieces.tests(&whitener.whiten(&misfit), self.conditions)?;
        Some(tests.each().into_iter().map(|test| test.standardised()).collect())
    }
}

/// The differences of a parameter between the windows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DriftingParameter {
    /// The name of the parameter.
    pub name: String,
    /// The test of equality while all other parameters may differ too.
    pub equality: Equality,
    /// The test of equality while the others are equal everywhere.
    pub alone: Equality,
    /// The share of all differences that this parameter alone would explain, from the excess of the statistics over
    /// their degrees of freedom.
    pub explains: f64,
}

/// Tests of each parameter, with the share of all differences that it alone would explain.
pub(super) fn drifting(
    experiment: &Experiment<'_>,
    tests: &EqualityTests,
) -> Vec<DriftingParameter> {
    let excess = |e: &Equality| (e.statistic - e.freedom as f64).max(0.0);
    let whole = excess(&tests.all).max(f64::MIN_POSITIVE);
    let each = tests.marginal.iter().zip(&tests.alone);
    let of =
        |(parameter, (equality, alone)): (&Parameter, (&Equality, &Equality))| DriftingParameter {
            name: parameter.name.clone(),
            equality: *equality,
            alone: *alone,
            explains: (excess(alone) / whole).min(1.0),
        };
    experiment.parameters.iter().zip(each).map(of).collect()
}
