//! Stage 5: sampling of the posterior of the parameters.

mod kept;
mod law;
mod near;
mod population;
mod predicting;

use std::path::Path;

use lacuna::data::{Draws, Observations, Statistics, Unit};
use lacuna::diagnose::Diagnosis;
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::sampler::{Evidence, Start};
use lacuna::plugin::{Fact, Forward, Likelihood, Sampler, Target};
use lacuna::run::{Observer, Progress, Stop};
use lacuna_linalg::Matrix;
use lacuna_run::{Folder, Kept, RunDirectory, Stage};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::read::Measured;
use super::sampling::{Length, Sampled};
use super::start::{inside, maxima, sobol};
use super::{best_fit, sampling};
use crate::posterior::{Joint, OfData, Posterior};
use crate::stage::inverse_problem::{InverseProblem, Trial};
use crate::study::Study;

pub use law::Law;
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
    likelihood: Box<dyn Likelihood>,
}

impl Parts {
    /// The likelihood of the study's measurements, with the common errors that the study includes.
    pub fn of(
        study: &Study,
        measured: &Measured,
        problem: &InverseProblem<'_>,
    ) -> Result<Self, Stop> {
        let law = Law::of(study, measured, problem)?;
        Self::with(study, |i| law.block(i))
    }

    /// Like [`Self::of`], but with the errors of emulator and numerics at their actual size, for predictions: for
    /// estimates they are enlarged. If the discrepancy samples these errors, its predictions contain them completely,
    /// whatever part was sampled (`predicting::Added`).
    pub fn predicting(
        study: &Study,
        measured: &Measured,
        problem: &InverseProblem<'_>,
    ) -> Result<Self, Stop> {
        let law = Law::predicting(study, measured, problem)?;
        let bare = Law::bare(study, &measured.likelihood, problem.forward())?;
        let unknowns = |law: &dyn Likelihood| law.hyperparameters().len();
        let block = |i| {
            let (whole, alone) = (law.block(i)?, bare.block(i)?);
            if unknowns(&*whole) == unknowns(&*alone) {
                return Ok(whole);
            }
            let sampled = Law::of(study, measured, problem)?.block(i)?;
            let added = predicting::Added::new(alone, law.errors(i)?, sampled.hyperparameters())?;
            Ok(Box::new(added) as Box<dyn Likelihood>)
        };
        Self::with(study, block)
    }

    /// The likelihood of data without any common error: the discrepancy alone.
    pub fn bare(study: &Study, data: &Observations, forward: &dyn Forward) -> Result<Self, Stop> {
        let law = Law::bare(study, data, forward)?;
        Self::with(study, |i| law.block(i))
    }

    fn with(
        study: &Study,
        block: impl FnMut(usize) -> Result<Box<dyn Likelihood>, Stop>,
    ) -> Result<Self, Stop> {
        let layouts = &study.layouts;
        let mut likelihoods: Vec<Box<dyn Likelihood>> =
            (0..layouts.blocks.len()).map(block).collect::<Result<_, _>>()?;
        let likelihood = match likelihoods.len() {
            1 => likelihoods.remove(0),
            _ => Box::new(Joint::new(layouts, likelihoods)),
        };
        Ok(Self { likelihood })
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
        let likelihood = OfData::new(problem.forward(), study.placed_effects(), self.likelihood());
        Posterior::new(study.prior(), likelihood).within(problem.region().map(<[_]>::to_vec))
    }
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
    let kept = run.keep(folder, inputs, observer, |folder| {
        calibrate(study, posterior, trial, folder, observer)
    })?;
    observer.end(Stage::Calibrate.label(), &summary(&kept.value));
    Ok(kept)
}

fn summary(calibrated: &Calibrated) -> String {
    let (draws, outcome) = (&calibrated.draws, &calibrated.outcome);
    let state = if outcome.diagnosis.converged { "converged" } else { "not converged" };
    format!("{} chains x {} steps, {state}", draws.chains, draws.steps)
}

fn calibrate(
    study: &Study,
    posterior: &Posterior<'_>,
    trial: Option<Trial>,
    folder: &Path,
    observer: &dyn Observer,
) -> Result<Calibrated, Stop> {
    let section = study.sampler.as_ref().ok_or_else(|| Stop::new("the study has no sampler"))?;
    let random = Trial::stream(trial, study, "calibrate");
    let maxima = maxima(posterior, &study.start(), &random.named("optimise"));
    sampling::broken(posterior)?;
    let mut maxima = maxima?;
    let adapted = population::adapted(study, posterior, &mut maxima)?;
    let posterior = adapted.as_ref().unwrap_or(posterior);
    let best = &maxima[0];
    let plan = section.built.plugin.plan(posterior.dimension());
    let sampler = &*section.built.plugin;
    let start = || starts(posterior, sampler, section.common.start, &best.point, &random);
    let coordinates = coordinates(study, posterior);
    let progress = Progress::new(observer);
    let length = Length {
        burn_in: section.common.burn_in.get(),
        stop: section.common.stop.as_ref(),
        half: trial.is_some_and(|trial| trial.quick),
    };
    let mut sampled = sampling::sample(
        &*section.built.plugin,
        posterior,
        length,
        start,
        &random.named("sample"),
        folder,
        &progress,
    )?;
    sampled.draws.names = coordinates.iter().map(|c| c.name.clone()).collect();
    let other_maxima = maxima[1..]
        .iter()
        .filter(|m| best.value - m.value < 10.0)
        .map(|m| (posterior.natural(&m.point), m.value))
        .collect();
    let best_draw = best_draw(posterior, &sampled);
    let draws = natural(posterior, sampled.draws);
    let kept = draws.from_step(sampled.burn_in);
    let diagnosis = if let Some(harvest) = &sampled.harvest {
        Diagnosis::of_harvest(&kept, harvest.effective_size, &harvest.doubts)
    } else {
        let sampler = &section.built.plugin;
        let (doubts, notes) = (sampler.doubts(&sampled.state), sampler.notes(&sampled.state));
        Diagnosis::of(&kept, plan.ensemble).with_notes(notes).with_doubts(doubts)
    };
    let (harvested, evidence) =
        sampled.harvest.map_or_else(Default::default, |h| (h.facts, h.evidence));
    let mut evidence = evidence.or_else(|| section.built.plugin.evidence(&sampled.state));
    if let Some(evidence) = &mut evidence {
        let (log, error) = posterior.log_share();
        evidence.log += log;
        evidence.error = evidence.error.hypot(error).hypot(posterior.prior().log_error());
    }
    let outcome = Outcome {
        coordinates,
        map: posterior.natural(&best.point),
        map_log_density: best.value,
        other_maxima,
        best_draw,
        burn_in: sampled.burn_in,
        acceptance: sampled.acceptance,
        diagnosis,
        evaluations: sampled.state.evaluations,
        facts: [posterior.facts(), section.built.plugin.facts(), harvested].concat(),
        evidence,
        populations: population::outcomes(study, posterior, &kept),
    };
    Ok(Calibrated { draws, statistics: sampled.statistics, outcome })
}

/// Starting points, one per chain.
fn starts(
    posterior: &Posterior<'_>,
    sampler: &dyn Sampler,
    wanted: Option<Start>,
    best: &[f64],
    random: &Stream,
) -> Result<Matrix, Stop> {
    let chains = sampler.plan(posterior.dimension()).chains;
    let random = random.named("start");
    // A method that draws its own starting points needs only the right number of points, whatever their density.
    if !sampler.uses_starts() {
        return Ok(posterior.prior_draws(chains, &random));
    }
    match wanted.unwrap_or_else(|| sampler.start_where()) {
        Start::Prior => inside(posterior, chains, |piece| {
            let more = random.named("more").at(piece as u64);
            Ok(posterior.prior_draws(4 * chains, if piece == 0 { &random } else { &more }))
        }),
        Start::Sobol => {
            inside(posterior, chains, |piece| sobol(posterior, 4 * chains * piece, 4 * chains))
        }
        Start::Map if !posterior.centred().is_empty() => {
            near::around(posterior, best, |near, best| around(near, best, chains, &random))
        }
        Start::Map => around(posterior, best, chains, &random),
    }
}

/// Starting points around a maximum.
fn around(
    target: &dyn Target,
    best: &[f64],
    chains: usize,
    random: &Stream,
) -> Result<Matrix, Stop> {
    match lacuna_optimise::laplace(target, best) {
        Ok(laplace) => lacuna_optimise::scatter(target, best, &laplace, chains, random),
        Err(_) => lacuna_optimise::scatter_without_bounds(target, best, chains, random),
    }
}

fn coordinates(study: &Study, posterior: &Posterior<'_>) -> Vec<Coordinate> {
    let parameters = study.parameters.iter().map(|p| Coordinate {
        name: p.name.clone(),
        symbol: p.symbol.clone(),
        unit: p.unit.clone(),
        prior: Some(p.prior.clone()),
        reference: p.reference,
    });
    let hyper = posterior.hyperparameters().iter().map(|h| Coordinate {
        name: h.name.clone(),
        symbol: h.symbol.clone(),
        unit: h.unit.clone(),
        prior: Some(h.prior.clone()),
        reference: None,
    });
    parameters.chain(hyper).collect()
}

fn best_draw(posterior: &Posterior<'_>, sampled: &Sampled) -> (Vec<f64>, f64) {
    let draws = &sampled.draws;
    let Some((chain, step)) = draws.best() else { return (Vec::new(), f64::NEG_INFINITY) };
    let point = draws.point(chain, step);
    let row = Matrix::from_vec(1, point.len(), point.to_vec());
    (posterior.natural(point), posterior.mode().log_density(&row)[0])
}

fn natural(posterior: &Posterior<'_>, mut draws: Draws) -> Draws {
    let d = draws.dimension();
    for point in draws.values.chunks_exact_mut(d) {
        let values = posterior.natural(point);
        point.copy_from_slice(&values);
    }
    draws
}
