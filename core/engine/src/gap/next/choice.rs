//! An option: data that are taken, and what they are expected to be under a hypothesis.

use lacuna_linalg::Matrix;

use super::hypothesis::Hypothesis;
use super::information::Predicted;
use crate::gap::experiment::{ErrorShares, Experiment};
use crate::gap::noise::Noise;
use crate::gap::system::whitener::Whitener;

/// Data that could be taken.
pub(super) struct Choice<'a> {
    /// The name in the results.
    pub name: String,
    /// The cost.
    pub cost: f64,
    /// The data.
    pub taken: Taken<'a>,
}

/// Data of an option.
pub(super) enum Taken<'a> {
    /// Further replicates of the curves of an experiment.
    Replicates {
        /// The number of replicates.
        count: usize,
        /// The curves, and the noise of one replicate.
        planned: Box<(Experiment<'a>, Noise)>,
    },
    /// Runs that make the errors of emulator and numerics smaller by these factors.
    Errors {
        /// The factor of the emulator's error.
        emulator: f64,
        /// The factor of the numerical error.
        numerics: f64,
        /// The share of each origin in the variance of each known error.
        origins: Vec<ErrorShares>,
    },
}

impl Choice<'_> {
    /// The new data under a hypothesis, less a response that all hypotheses share, in coordinates in which their noise is
    /// independent with variance one.
    pub fn predicted(&self, own: &Hypothesis, reference: &Hypothesis) -> Predicted {
        match &self.taken {
            Taken::Replicates { count, planned } => replicates(*count, planned, own, reference),
            Taken::Errors { emulator, numerics, origins } => {
                let known = |shares: &ErrorShares| {
                    shares.emulator * (1.0 - emulator * emulator)
                        + shares.numerics * (1.0 - numerics * numerics)
                };
                errors(&origins.iter().map(known).collect::<Vec<_>>(), own, reference)
            }
        }
    }
}

fn replicates(
    count: usize,
    (experiment, noise): &(Experiment<'_>, Noise),
    own: &Hypothesis,
    reference: &Hypothesis,
) -> Predicted {
    let counts = vec![count as f64; experiment.outputs()];
    let around = &reference.response;
    let whitener = Whitener::of_counts(experiment, noise, around, &counts);
    let difference = own.response.iter().zip(around).map(|(a, b)| a - b);
    let rows = Matrix::from_rows(around.len(), [difference.collect::<Vec<f64>>()]);
    let chosen: Vec<usize> =
        experiment.curves.iter().flat_map(|curve| curve.measured.iter().copied()).collect();
    Predicted {
        mean: whitener.whiten_rows(&rows).select_columns(&chosen).into_vec(),
        slopes: whitener.whiten_rows(&own.tangents).select_columns(&chosen),
        precision: own.precision.clone(),
    }
}

/// Runs that leave the share `1 - known` of the variance of each error: an observation of its size, whose prior variance
/// is one, with the variance `(1 - known) / known`.
fn errors(known: &[f64], own: &Hypothesis, reference: &Hypothesis) -> Predicted {
    let seen: Vec<(usize, f64)> = known
        .iter()
        .enumerate()
        .filter(|(_, known)| **known > 0.0)
        .map(|(k, known)| (k, (known / (1.0 - known).max(LEAST)).sqrt()))
        .collect();
    let mean = seen.iter().map(|(k, scale)| scale * (own.errors[*k] - reference.errors[*k]));
    let mut slopes = Matrix::zeros(own.tangents.rows(), seen.len());
    for (i, (k, scale)) in seen.iter().enumerate() {
        slopes[(own.first_error + k, i)] = *scale;
    }
    Predicted { mean: mean.collect(), slopes, precision: own.precision.clone() }
}

/// The smallest share of the variance of an error that runs leave.
const LEAST: f64 = 1e-6;
