//! Stage 5: the posterior of the parameters.

mod kept;
mod law;

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::data::{Draws, Observations, Statistics, Unit};
use crate::diagnose::Diagnosis;
use crate::linalg::Matrix;
use crate::math::distribution::Distribution;
use crate::math::optimise;
use crate::math::random::Stream;
use crate::plugin::sampler::Evidence;
use crate::plugin::{Fact, Forward, Likelihood, Sampler, Target};
use crate::posterior::{Joint, OfData, Posterior};
use crate::run::{Kept, Observer, Progress, RunDirectory, Stop};
use crate::study::Study;
use crate::study::file::Start;

pub use law::Law;

use super::read::Measured;
use super::sampling::{self, Length, Sampled};
use super::start::{inside, maxima, sobol};
use super::{Known, Trial, best_fit};

/// The posterior as draws, with its maximum.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrated {
    /// All draws in natural units, burn-in included.
    pub draws: Draws,
    /// What the sampler told of the steps, burn-in included.
    pub statistics: Statistics,
    /// The rest.
    pub outcome: Outcome,
}

/// What a calibration found besides its draws.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The coordinates, parameters first.
    pub coordinates: Vec<Coordinate>,
    /// The point of largest posterior density, natural units, found by optimisation.
    pub map: Vec<f64>,
    /// The log posterior density there, without the Jacobian of logarithmic coordinates.
    pub map_log_density: f64,
    /// Other local maxima within ten of the best, with their log densities.
    pub other_maxima: Vec<(Vec<f64>, f64)>,
    /// The draw with the largest density, natural units, and its log density.
    pub best_draw: (Vec<f64>, f64),
    /// The number of first steps that are burn-in.
    pub burn_in: usize,
    /// The share of accepted moves of each chain.
    pub acceptance: Vec<f64>,
    /// The judgement on the draws after burn-in.
    pub diagnosis: Diagnosis,
    /// Evaluations of the log density.
    pub evaluations: u64,
    /// Facts about the likelihood and the sampler.
    pub facts: Vec<Fact>,
    /// The probability of the data, where it is known.
    pub evidence: Option<Evidence>,
}

/// A coordinate of the posterior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coordinate {
    /// Its name.
    pub name: String,
    /// Its symbol.
    pub symbol: String,
    /// Its unit.
    pub unit: Unit,
    /// Its prior; that of a derived quantity is nowhere written.
    pub prior: Option<Distribution>,
    /// Its reference value.
    pub reference: Option<f64>,
}

/// The parts of a posterior that outlive the stage.
pub struct Parts {
    likelihood: Box<dyn Likelihood>,
}

impl Parts {
    /// The likelihood of the study's measurements, with the common errors that the study wants.
    pub fn of(study: &Study, measured: &Measured, known: &Known<'_>) -> Result<Self, Stop> {
        Self::with(study, &Law::of(study, measured, known)?)
    }

    /// The same likelihood with errors of emulator and numerics as large as they are themselves, for predictions: that of
    /// [`Self::of`] enlarges them for the sake of the estimates. A discrepancy that samples these errors has them as unknowns, of
    /// the size at which they were sampled.
    pub fn predicting(study: &Study, measured: &Measured, known: &Known<'_>) -> Result<Self, Stop> {
        let parts = Self::with(study, &Law::predicting(study, measured, known)?)?;
        let bare = Self::bare(study, &measured.likelihood, known.forward)?;
        let unknowns = |parts: &Self| parts.likelihood.hyperparameters().len();
        if unknowns(&parts) == unknowns(&bare) {
            Ok(parts)
        } else {
            Self::of(study, measured, known)
        }
    }

    /// The likelihood of data without any common error: what the discrepancy alone says of them.
    pub fn bare(study: &Study, data: &Observations, forward: &dyn Forward) -> Result<Self, Stop> {
        Self::with(study, &Law::bare(study, data, forward)?)
    }

    fn with(study: &Study, law: &Law<'_>) -> Result<Self, Stop> {
        let layouts = &study.layouts;
        let mut likelihoods: Vec<Box<dyn Likelihood>> =
            (0..layouts.blocks.len()).map(|i| law.block(i)).collect::<Result<_, _>>()?;
        let likelihood = match likelihoods.len() {
            1 => likelihoods.remove(0),
            _ => Box::new(Joint::new(layouts, likelihoods)),
        };
        Ok(Self { likelihood })
    }

    /// The likelihood.
    pub fn likelihood(&self) -> &dyn Likelihood {
        &*self.likelihood
    }

    /// The posterior of a study with this forward map.
    pub fn posterior<'a>(&'a self, study: &'a Study, known: &Known<'a>) -> Posterior<'a> {
        let likelihood = OfData::new(known.forward, study.placed_effects(), self.likelihood());
        Posterior::new(&study.parameters, likelihood).within(known.region.map(<[_]>::to_vec))
    }
}

/// The forward map's own variance of each output where it fits the data best; `None` when it knows none.
pub(super) fn stated_variance(
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

/// Draws from the posterior; `None` when the study has no measurements.
pub fn stage(
    study: &Study,
    known: &Known<'_>,
    folder: &str,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<Calibrated>>, Stop> {
    let (Some(measured), Some(section), Some(discrepancy)) =
        (&known.data.value.measured, &study.sampler, &study.discrepancy)
    else {
        return Ok(None);
    };
    let laws: Vec<_> = study.parameters.iter().map(|p| (&p.name, &p.prior, p.reference)).collect();
    let effects: Vec<_> = study.effects.iter().map(|e| (e.built.identity(), &e.common)).collect();
    let inputs = json!([
        known.data.hash,
        known.origin,
        known.numerics.map(|n| &n.hash),
        study.numerical_error.as_ref().map(|section| section.written.scales()),
        known.region,
        laws,
        (discrepancy.built.identity(), &discrepancy.common),
        effects,
        (section.built.identity(), &section.common),
        study.about.seed
    ]);
    let parts = Parts::of(study, measured, known)?;
    let posterior = parts.posterior(study, known);
    draw(study, &posterior, known.trial, folder, &inputs, run, observer).map(Some)
}

/// Draws from any posterior, kept in a folder.
pub fn draw(
    study: &Study,
    posterior: &Posterior<'_>,
    trial: Option<Trial>,
    folder: &str,
    inputs: &impl Serialize,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Calibrated>, Stop> {
    let section = study.sampler.as_ref().ok_or_else(|| Stop::new("the study has no sampler"))?;
    let plan = section.built.plugin.plan(posterior.dimension());
    observer.begin("calibrate", "step", plan.steps as u64);
    let kept = run.keep(folder, inputs, observer, |folder| {
        calibrate(study, posterior, trial, folder, observer)
    })?;
    observer.end("calibrate", &summary(&kept.value));
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
    let maxima = maxima(posterior, &random.named("optimise"));
    sampling::broken(posterior)?;
    let maxima = maxima?;
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
    let (harvested, mut evidence) =
        sampled.harvest.map_or_else(Default::default, |h| (h.facts, h.evidence));
    if let Some(evidence) = &mut evidence {
        evidence.log += posterior.log_share();
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
    };
    Ok(Calibrated { draws, statistics: sampled.statistics, outcome })
}

/// One starting point a chain.
fn starts(
    posterior: &Posterior<'_>,
    sampler: &dyn Sampler,
    wanted: Option<Start>,
    best: &[f64],
    random: &Stream,
) -> Result<Matrix, Stop> {
    let chains = sampler.plan(posterior.dimension()).chains;
    let random = random.named("start");
    // A method that makes its own is given points of the right number, whatever their density.
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
        Start::Map => match optimise::laplace(posterior, best) {
            Ok(laplace) => optimise::scatter(posterior, best, &laplace, chains, &random),
            Err(_) => optimise::scatter_without_bounds(posterior, best, chains, &random),
        },
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
