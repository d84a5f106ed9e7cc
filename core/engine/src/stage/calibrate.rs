//! Stage 5: sampling of the posterior of the parameters.

mod cut;
mod estimated;
mod kept;
mod law;
mod near;
mod outline;
mod population;
mod predicting;
mod sample;
mod slopes;

use std::sync::Arc;

use lacuna::data::{Draws, Observations, Statistics, Unit};
use lacuna::diagnose::Diagnosis;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::sampler::Evidence;
use lacuna::plugin::{Fact, Forward, Likelihood, Target};
use lacuna::run::{Observer, Progress, Stop};
use lacuna_linalg::Matrix;
use lacuna_run::{Folder, Kept, RunDirectory, Stage};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::best_fit;
use super::read::Measured;
use crate::posterior::{Joint, OfData, Posterior};
use crate::stage::inverse_problem::{InverseProblem, Trial};
use crate::study::{Study, hierarchy};

use cut::sample_cut;
use sample::{Asked, sample};

pub use cut::CutOutcome;
pub use estimated::LikelihoodEstimate;
pub use law::Law;
pub use outline::{Outline, OutlinedCoordinate};
pub use population::{MemberOutcome, NewMember, PopulationOutcome};

/// The posterior as draws, with its maximum.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrated {
    /// All draws in natural units, including burn-in.
    pub draws: Draws,
    /// Statistics that the sampler reported for each step, including burn-in.
    pub statistics: Statistics,
    /// All other results.
    pub outcome: Outcome,
}

/// Results of a calibration besides its draws.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Coordinates of the posterior, parameters first.
    pub coordinates: Vec<Coordinate>,
    /// Maximum a posteriori (MAP) in natural units, found by optimisation.
    pub map: Vec<f64>,
    /// Log posterior density at the MAP, without the Jacobian of logarithmic coordinates.
    pub map_log_density: f64,
    /// Other local maxima within ten log units of the best, with their log densities.
    pub other_maxima: Vec<(Vec<f64>, f64)>,
    /// Draw with the largest density, in natural units, and its log density.
    pub best_draw: (Vec<f64>, f64),
    /// Number of initial steps that are burn-in.
    pub burn_in: usize,
    /// Acceptance rate of each chain.
    pub acceptance: Vec<f64>,
    /// Convergence diagnosis of the draws after burn-in.
    pub diagnosis: Diagnosis,
    /// Number of evaluations of the log density.
    pub evaluations: u64,
    /// Facts about the likelihood and the sampler.
    pub facts: Vec<Fact>,
    /// Evidence, if it is known.
    pub evidence: Option<Evidence>,
    /// Estimate of the likelihood from runs of a stochastic model; `None` if the likelihood is not estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub estimate: Option<LikelihoodEstimate>,
    /// Parameters that the data do not update; `None` if there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cut: Option<CutOutcome>,
    /// Populations, in the order of the study's parameters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub populations: Vec<PopulationOutcome>,
}

impl Outcome {
    /// Degree to which the coordinate of each member of a population was centred.
    pub fn centred(&self) -> impl Iterator<Item = f64> {
        self.populations.iter().flat_map(|population| &population.members).map(|m| m.centred)
    }
}

/// A coordinate of the posterior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coordinate {
    /// Name of the coordinate.
    pub name: String,
    /// Symbol used in figures.
    pub symbol: String,
    /// Unit of the coordinate.
    pub unit: Unit,
    /// Prior of the coordinate; `None` for a derived quantity, whose prior is not stated.
    pub prior: Option<Distribution>,
    /// Reference value, if the study gives one.
    pub reference: Option<f64>,
}

/// Parts of a posterior that outlive the stage.
pub struct Parts {
    likelihood: Arc<dyn Likelihood>,
}

impl Parts {
    /// The likelihood of the study's measurements, which are those of the problem, with the common errors that the study
    /// includes. It is made once for a problem.
    pub fn of(
        study: &Study,
        measured: &Measured,
        problem: &InverseProblem<'_>,
    ) -> Result<Self, Stop> {
        let likelihood = problem.likelihood(|| {
            let law = Law::of(study, measured, problem)?;
            joint(study, |i| law.block(i))
        })?;
        Ok(Self { likelihood })
    }

    /// Like [`Self::of`], but with the errors of emulator and numerics at their actual size, for predictions: for
    /// estimates they are enlarged. If the discrepancy samples these errors, its predictions contain them completely,
    /// whatever part was sampled (`predicting::Added`).
    pub fn predicting(
        study: &Study,
        measured: &Measured,
        problem: &InverseProblem<'_>,
    ) -> Result<Self, Stop> {
        let likelihood = problem.predictive(|| {
            let law = Law::predicting(study, measured, problem)?;
            let bare = Law::bare(study, &measured.likelihood, problem.forward())?;
            let unknowns = |law: &dyn Likelihood| law.hyperparameters().len();
            joint(study, |i| {
                let (whole, alone) = (law.block(i)?, bare.block(i)?);
                if unknowns(&*whole) == unknowns(&*alone) {
                    return Ok(whole);
                }
                let sampled = Law::of(study, measured, problem)?.block(i)?;
                let own = sampled.hyperparameters();
                Ok(Box::new(predicting::Added::new(alone, law.errors(i)?, own)?))
            })
        })?;
        Ok(Self { likelihood })
    }

    /// The likelihood of data without any common error: the discrepancy alone.
    pub fn bare(study: &Study, data: &Observations, forward: &dyn Forward) -> Result<Self, Stop> {
        let law = Law::bare(study, data, forward)?;
        Ok(Self { likelihood: joint(study, |i| law.block(i))? })
    }

    /// The likelihood of all blocks.
    pub fn likelihood(&self) -> &dyn Likelihood {
        &*self.likelihood
    }

    /// The posterior of a study with the forward map of this inverse problem.
    pub fn posterior<'a>(
        &'a self,
        study: &'a Study,
        problem: &InverseProblem<'a>,
    ) -> Posterior<'a> {
        let effects = study.placed_effects();
        Self::of_likelihood(
            study,
            problem,
            OfData::new(problem.forward(), effects, self.likelihood()),
        )
    }

    /// That posterior where its prior and its coordinates are asked, and its density hardly.
    pub fn uncompressed_posterior<'a>(
        &'a self,
        study: &'a Study,
        problem: &InverseProblem<'a>,
    ) -> Posterior<'a> {
        let (forward, effects) = (problem.forward(), study.placed_effects());
        Self::of_likelihood(
            study,
            problem,
            OfData::uncompressed(forward, effects, self.likelihood()),
        )
    }

    fn of_likelihood<'a>(
        study: &'a Study,
        problem: &InverseProblem<'a>,
        likelihood: OfData<'a>,
    ) -> Posterior<'a> {
        let likelihood = likelihood.pooled(|all| hierarchy::populations(&study.pools(), all));
        Posterior::new(study.prior(), likelihood).within(problem.region().map(<[_]>::to_vec))
    }
}

/// The likelihood of all blocks, given that of each.
fn joint(
    study: &Study,
    block: impl FnMut(usize) -> Result<Box<dyn Likelihood>, Stop>,
) -> Result<Arc<dyn Likelihood>, Stop> {
    let layouts = &study.layouts;
    let mut likelihoods: Vec<Box<dyn Likelihood>> =
        (0..layouts.blocks.len()).map(block).collect::<Result<_, _>>()?;
    let pools = study.pools();
    if likelihoods.len() == 1 && pools.is_empty() {
        return Ok(likelihoods.remove(0).into());
    }
    let joint = Joint::new(layouts, likelihoods);
    let effects = study.placed_effects().into_iter().flat_map(|own| own.hyperparameters());
    let all: Vec<_> = effects.chain(joint.hyperparameters().iter().cloned()).collect();
    let besides = hierarchy::unknowns(&pools, &all)?;
    Ok(Arc::new(joint.with_besides(besides)))
}

/// Variance that the forward map itself states for each output where it fits the data best; `None` if it states none.
pub fn stated_variance(
    study: &Study,
    data: &Observations,
    forward: &dyn Forward,
) -> Result<Option<Vec<f64>>, Stop> {
    let centre: Vec<f64> = study.parameters.iter().map(|p| p.prior.quantile(0.5)).collect();
    if forward.variance(&Matrix::from_vec(1, centre.len(), centre)).is_none() {
        return Ok(None);
    }
    let best = best_fit::point(study, data, forward)?;
    let variance = forward.variance(&Matrix::from_vec(1, best.len(), best));
    Ok(variance.map(Matrix::into_vec))
}

/// Samples the posterior; `None` if the study has no measurements.
pub fn stage(
    study: &Study,
    problem: &InverseProblem<'_>,
    folder: &Folder,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<Calibrated>>, Stop> {
    let (Some(measured), Some(section), Some(discrepancy)) =
        (&problem.data.value.measured, &study.sampler, &study.discrepancy)
    else {
        return Ok(None);
    };
    let laws: Vec<_> = study.parameters.iter().map(|p| (&p.name, &p.prior, p.reference)).collect();
    let laws = study.prior_identity(json!(laws));
    let effects = study.effects_identity();
    let inputs = json!([
        problem.data.hash,
        problem.origin(),
        problem.numerics().map(|n| &n.hash),
        study.numerical_error.as_ref().map(|section| section.written.scales()),
        problem.region(),
        laws,
        (discrepancy.built.identity(), &discrepancy.common),
        effects,
        (section.built.identity(), &section.common),
        &study.starts,
        study.about.seed
    ]);
    let parts = Parts::of(study, measured, problem)?;
    let posterior = parts.posterior(study, problem);
    draw(study, &posterior, problem.trial, folder, &inputs, run, observer).map(Some)
}

/// Samples any posterior and keeps the draws in a folder.
pub fn draw(
    study: &Study,
    posterior: &Posterior<'_>,
    trial: Option<Trial>,
    folder: &Folder,
    inputs: &impl Serialize,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Calibrated>, Stop> {
    let section = study.sampler.as_ref().ok_or_else(|| Stop::new("the study has no sampler"))?;
    let plan = section.built.plugin.plan(posterior.dimension());
    observer.begin(Stage::Calibrate.label(), "step", plan.steps as u64);
    let progress = Progress::new(observer);
    let asked = Asked {
        study,
        posterior,
        stated: study.start(),
        random: Trial::stream(trial, study, "calibrate"),
        quick: trial.is_some_and(|trial| trial.quick),
    };
    let cut = study.cut();
    let kept = if cut.is_empty() {
        run.keep(folder, inputs, observer, |folder| sample(&asked, folder, &progress))?
    } else {
        let inputs = json!([inputs, cut]);
        run.keep(folder, &inputs, observer, |folder| sample_cut(&asked, &cut, folder, &progress))?
    };
    observer.end(Stage::Calibrate.label(), &summary(&kept.value));
    Ok(kept)
}

fn summary(calibrated: &Calibrated) -> String {
    let (draws, outcome) = (&calibrated.draws, &calibrated.outcome);
    let state = if outcome.diagnosis.converged { "converged" } else { "not converged" };
    format!("{} chains x {} steps, {state}", draws.chains, draws.steps)
}
