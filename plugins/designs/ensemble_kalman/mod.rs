//! `ensemble_kalman`: batches of runs that move from the prior to the posterior.

#[cfg(test)]
mod tests;
mod update;

use lacuna::math::random::Stream;
use lacuna::plugin::design::{Batch, Next};
use lacuna::plugin::{Component, Context, Design};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::latin_hypercube::LatinHypercube;
use update::{moved, step};

/// Ensemble Kalman inversion: batches of runs, each placed by what the batch before it returned, that move from the
/// parameters' `design` distributions to the posterior.
///
/// Use it if only a few hundred runs can be paid, or if the priors are so wide that a design over all of them would
/// have hardly any run near the posterior. `runs` is the size of one batch (the ensemble): several times the number of
/// parameters, at least 20 as a rule. The first batch is a Latin hypercube. The number of batches follows from the
/// data, usually 3 to 7, and is at most `iterations` more than the first. The surrogate is then fitted to the runs of
/// all batches inside a box around the last one, and the posterior is sampled inside that box; `refine` of
/// `[surrogate]` goes on from there (calibrate, emulate, sample).
///
/// Each batch multiplies its law by a part of the likelihood, `likelihood^h`; `h` is chosen from the misfits so that no
/// batch moves too far, larger only if the whole likelihood would otherwise not be reached within `iterations`; the
/// batches end if the parts add up to it. For a linear model with normal
/// errors and priors the last batch has the mean and covariance of the posterior, up to the error of a sample of its
/// size. Otherwise it is an approximation that serves to place runs, and the posterior is never computed from it.
///
/// The noise of a datum is that of the mean of its replicates: as stated by the data or by `[discrepancy]`, from the
/// scatter of the replicates, but at least the residual of the best run so far, so that data which the model cannot
/// reproduce do not draw all runs to one point. Data are taken as independent of each other. A run that fails is replaced by a draw from the normal distribution of the others.
///
/// References: Iglesias, Law and Stuart, Inverse Problems 29 (2013) 045001; Iglesias and Yang, Inverse Problems 37
/// (2021) 025008 (the choice of `h`); Bishop, Etherton and Majumdar, Monthly Weather Review 129 (2001) 420
/// (`transform`); Cleary, Garbuno-Inigo, Lan, Schneider and Stuart, Journal of Computational Physics 424 (2021) 109716
/// (calibrate, emulate, sample).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EnsembleKalman {
    /// Maximum number of batches after the first. More of them move in smaller steps if the misfits are large.
    pub iterations: usize,
    /// Update of the ensemble.
    pub update: Update,
}

/// Update of an ensemble by data.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Update {
    /// Mean and deviations are transformed (square root filter): no random numbers, and no error besides that of the
    /// first batch.
    #[default]
    Transform,
    /// Each run is compared with data of its own, to which random noise is added (Iglesias, Law and Stuart 2013): the
    /// batches scatter more.
    PerturbedData,
}

impl Default for EnsembleKalman {
    fn default() -> Self {
        Self { iterations: 6, update: Update::default() }
    }
}

impl Component for EnsembleKalman {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let least = context.parameters.len() + 2;
        if context.runs.is_some_and(|runs| runs < least) {
            complaints
                .at("runs")
                .say("the ensemble is too small for the number of parameters")
                .expected(format!("at least {least}, better several times as many"));
        }
        if self.iterations == 0 {
            complaints
                .at("iterations")
                .say("the ensemble would never move")
                .expected("at least 1")
                .found(0);
        }
    }
}

impl Design for EnsembleKalman {
    fn points(&self, count: usize, dimension: usize, stream: &Stream) -> Result<Matrix, Stop> {
        LatinHypercube::default().points(count, dimension, stream)
    }

    fn is_sequential(&self) -> bool {
        true
    }

    fn next(&self, batches: &[Batch], stream: &Stream) -> Result<Next, Stop> {
        let Some(last) = batches.last() else {
            return Err(Stop::new("the ensemble has no first batch"));
        };
        if let Some(few) = batches.iter().find(|batch| batch.scores.rows() < 3) {
            let (left, placed) = (few.scores.rows(), few.placed);
            return Err(Stop::new(format!(
                "{left} of {placed} runs of a batch have a response, too few to go on"
            ))
            .help("look at the reasons of the failures in the table of the runs, or narrow the `design`"));
        }
        let mut time = 0.0;
        let count = batches.len();
        let left = |k: usize| self.iterations.saturating_sub(k);
        for (k, batch) in batches[..count - 1].iter().enumerate() {
            time += step(&batch.residuals, time, left(k));
        }
        if time >= 1.0 - 1e-12 || count > self.iterations {
            return Ok(Next::Complete(format!("{count} batches")));
        }
        let own = stream.named("batch").at(count as u64);
        moved(last, step(&last.residuals, time, left(count - 1)), self.update, &own)
            .map(Next::Place)
    }
}

lacuna::register!(Design, "ensemble_kalman", EnsembleKalman, aliases: ["eki", "ensemble_kalman_inversion"]);
