//! Calibration with sequential refinement: further runs where posterior density and emulator error are large.
//!
//! Each round chooses new points one after the other among draws of the posterior and an even cover of the region, by
//! the largest product of the emulator's error there and the distance from all runs (a weighted maximin rule after
//! Johnson, Moore and Ylvisaker, J. Stat. Plan. Inference 26 (1990) 131); runs them; fits the surrogate to the runs in
//! the region; and calibrates again.

mod choose;

use lacuna::data::{Draws, Ensemble, Parameter};
use lacuna::math::distribution::Distribution;
use lacuna::math::moments;
use lacuna::plugin::Emulator;
use lacuna::plugin::discrepancy::ErrorOrigin;
use lacuna::run::{Observer, Stop};
use lacuna_linalg::Matrix;
use lacuna_run::{Folder, Kept, RunDirectory, Stage};
use serde_json::json;

use super::calibrate::{self, Calibrated, Parts};
use super::numerical_error::{self, NumericalError};
use super::read::{self, Data, Runs};
use super::simulate;
use super::simulator::Simulator;
use super::surrogate::{self, Fitting, Purpose};
use crate::stage::emulated::Emulated;
use crate::stage::inverse_problem::Trial;
use crate::study::Study;
use crate::study::file::{Refine, Region};

/// One interval per parameter.
type Intervals = Vec<(f64, f64)>;

/// Calibrates, and refines as long as the study requests it and it is needed.
pub fn stage(
    study: &Study,
    mut learned: Emulated,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Emulated, Option<Kept<Calibrated>>), Stop> {
    let first =
        calibrate::stage(study, &learned.problem(), &Stage::Calibrate.folder(), run, observer)?;
    let refine = study.surrogate.as_ref().and_then(|s| s.common.refine.as_ref());
    let (Some(refine), Some(mut calibrated)) = (refine, first.clone()) else {
        return Ok((learned, first));
    };
    let mut halvings = 0;
    for round in 1..=refine.rounds.get() {
        let data = data_variance(study, &learned, &calibrated)?;
        halvings += i32::from(is_clear(study, learned.region.as_deref(), &kept(&calibrated)));
        let place = about(study, &kept(&calibrated), halvings);
        let (again, error) =
            next(study, refine, round, learned, &calibrated, place, run, observer)?;
        learned = again;
        let folder = folder(round, Stage::Calibrate);
        let again = calibrate::stage(study, &learned.problem(), &folder, run, observer)?;
        calibrated = again.ok_or_else(|| Stop::new("the study has no measurements"))?;
        let ratio = error / data.sqrt();
        let clear = is_clear(study, learned.region.as_deref(), &kept(&calibrated));
        let reached = ratio <= refine.until.get() && clear;
        let until = refine.until.get();
        let refinement = Refinement { rounds: round, ratio, until, clear, reached };
        observer.begin("refine", "round", refine.rounds.get() as u64);
        observer.end("refine", &refinement.summary(refine));
        if reached || round == refine.rounds.get() {
            learned.refinement = Some(refinement);
            break;
        }
    }
    Ok((learned, Some(calibrated)))
}

/// Folder of a stage in a round.
fn folder(round: usize, stage: Stage) -> Folder {
    stage.inside(Stage::Calibrate, &format!("refine-{round}"))
}

/// State of a refinement.
#[derive(Debug, Clone, PartialEq)]
pub struct Refinement {
    /// Number of rounds.
    pub rounds: usize,
    /// Ratio of the emulator's error at the last new runs, before it was trained on them, to the discrepancy: root mean
    /// squares over the outputs.
    pub ratio: f64,
    /// Ratio that the study requests.
    pub until: f64,
    /// True if the posterior stays clear of the region's own edges.
    pub clear: bool,
    /// True if the ratio is as small as requested and the posterior is clear of the region's edges.
    pub reached: bool,
}

impl Refinement {
    fn summary(&self, refine: &Refine) -> String {
        let edge =
            if self.clear { "" } else { ", and the posterior extends to the edge of the region" };
        let (rounds, until) = (self.rounds, refine.until.get());
        if self.ratio.is_infinite() {
            return format!(
                "after {rounds} rounds of refinement the region moved away from the runs{edge}"
            );
        }
        let ratio = self.ratio;
        format!(
            "after {rounds} rounds of refinement the emulator's error at new runs is {ratio:.3} of the discrepancy \
             (requested: {until}){edge}"
        )
    }
}

fn kept(calibrated: &Kept<Calibrated>) -> Draws {
    calibrated.value.draws.from_step(calibrated.value.outcome.burn_in)
}

/// Variance of the discrepancy at the best fit, mean over the outputs, without the errors of emulator and numerics.
fn data_variance(
    study: &Study,
    learned: &Emulated,
    calibrated: &Kept<Calibrated>,
) -> Result<f64, Stop> {
    let problem = learned.problem();
    let Some(measured) = &learned.data.value.measured else {
        return Err(Stop::new("the study has no measurements"));
    };
    let parts = Parts::of(study, measured, &problem)?;
    let map = &calibrated.value.outcome.map;
    let d = study.parameters.len();
    let own = parts.likelihood().hyperparameters().len();
    let mean = learned.emulator.mean(&Matrix::from_vec(1, d, map[..d].to_vec()));
    let spread = parts.likelihood().predictive(mean.row(0), &map[map.len() - own..]);
    let errors = [ErrorOrigin::Emulator, ErrorOrigin::Numerics];
    let of_data = spread.iter().filter(|part| !errors.contains(&part.origin));
    Ok(of_data.map(|part| moments::mean(&part.variance)).sum())
}

/// Central 99.8 % interval of each parameter's draws.
fn middle(draws: &Draws, parameters: usize) -> Intervals {
    let ends = |j: usize| {
        let sorted = moments::sorted(&draws.pooled(j));
        (moments::quantile(&sorted, 0.001), moments::quantile(&sorted, 0.999))
    };
    (0..parameters).map(ends).collect()
}

/// Bounds within which every region stays: those of design and prior.
fn bounds(parameter: &Parameter) -> (f64, f64) {
    let (design, prior) = (parameter.design.support(), parameter.prior.support());
    (design.0.max(prior.0), design.1.min(prior.1))
}

/// Returns true if the posterior stays inside the region, except at edges that are those of prior or design.
fn is_clear(study: &Study, region: Option<&[(f64, f64)]>, draws: &Draws) -> bool {
    let Some(region) = region else { return true };
    let middle = middle(draws, region.len());
    study.parameters.iter().zip(region).zip(middle).all(|((p, &(low, high)), (from, to))| {
        let (lowest, highest) = bounds(p);
        let margin = 0.05 * (high - low);
        (low <= lowest || from > low + margin) && (high >= highest || to < high - margin)
    })
}

/// A box around the posterior: at least twice as wide as its central interval, and as the range of the prior divided by
/// `2^halvings`.
///
/// A posterior from a poor emulator does not justify a small region, however narrow it is.
fn about(study: &Study, draws: &Draws, halvings: i32) -> Intervals {
    let middle = middle(draws, study.parameters.len());
    let boxed = |(p, (from, to)): (&Parameter, (f64, f64))| {
        let (lowest, highest) = bounds(p);
        let tails = [0.001, 0.999].map(|q| p.prior.quantile(q));
        let range = highest.min(tails[1]) - lowest.max(tails[0]);
        let half = (to - from).max(0.5 * range * 0.5_f64.powi(halvings));
        let (low, high) = (0.5 * (from + to) - half, 0.5 * (from + to) + half);
        // Shift the interval inside the bounds, then cut it if it is wider than they are.
        let shift = (lowest - low).max(0.0) - (high - highest).max(0.0);
        ((low + shift).max(lowest), (high + shift).min(highest))
    };
    study.parameters.iter().zip(middle).map(boxed).collect()
}

/// One round: new runs, and a new fit of the surrogate. Also returns the root mean square error of the previous
/// emulator at the new runs.
#[expect(clippy::too_many_arguments, reason = "what a round starts from, and where it works")]
fn next(
    study: &Study,
    refine: &Refine,
    round: usize,
    learned: Emulated,
    calibrated: &Kept<Calibrated>,
    place: Intervals,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Emulated, f64), Stop> {
    let draws = kept(calibrated);
    let trial = learned.trial;
    let random = Trial::stream(trial, study, "refine").at(round as u64);
    let points = choose::points(&learned, &draws, &place, refine.runs.get(), &random)?;
    let before = learned.data.value.runs()?.runs.len();
    let data = extended(study, round, learned.data, &points, run, observer)?;
    let ensemble = data.value.runs()?;
    let error = error_at_new(ensemble, before, &*learned.emulator, learned.region.as_deref())?;
    let parameters: Vec<Parameter>;
    let all = (0..ensemble.runs.len()).filter(|&i| surrogate::is_wanted(study, ensemble, i));
    let fitting = match refine.region {
        Region::Design => Fitting {
            folder: folder(round, Stage::Surrogate),
            parameters: &study.parameters,
            training: all.collect(),
            validation: Vec::new(),
            purpose: Purpose::Study,
        },
        Region::Posterior => {
            parameters = within(&study.parameters, &place);
            let inside = |i: &usize| is_inside(&place, ensemble.points.row(*i));
            Fitting {
                folder: folder(round, Stage::Surrogate),
                parameters: &parameters,
                training: all.filter(inside).collect(),
                validation: Vec::new(),
                purpose: Purpose::Study,
            }
        }
    };
    let (fitted, emulator) = surrogate::stage(study, &data, &fitting, run, observer)?;
    let stays = learned.numerics.as_ref().is_some_and(|kept| holds(&kept.value, &place));
    let numerics = if round == 1 || !stays {
        // The first runs near the posterior say more about its numerical error than those of the design; and once the
        // region extends beyond the runs of the estimate, the estimate is no longer valid.
        let finer = folder(round, Stage::Simulate).part("finer");
        let folders = [finer, folder(round, Stage::NumericalError)];
        numerical_error::stage(study, &data, Some(&place), &folders, run, observer)?
    } else {
        learned.numerics
    };
    let region = (refine.region == Region::Posterior).then_some(place);
    let again = Emulated::new(study, data, (fitted, emulator), numerics, trial)?;
    Ok((Emulated { region, ..again }, error))
}

/// Returns true if the estimate of the numerical error is valid in the whole region.
fn holds(numerics: &NumericalError, place: &[(f64, f64)]) -> bool {
    let inside = |(&(low, high), &(a, b)): (&(f64, f64), &(f64, f64))| low <= a && b <= high;
    numerics.region.as_ref().is_none_or(|region| region.iter().zip(place).all(inside))
}

/// Root mean square error of an emulator at the runs from `first` on that lie where it was fitted; infinite if there
/// are none.
fn error_at_new(
    ensemble: &Ensemble,
    first: usize,
    emulator: &dyn Emulator,
    region: Option<&[(f64, f64)]>,
) -> Result<f64, Stop> {
    if first == ensemble.runs.len() {
        return Err(Stop::new("none of the runs near the posterior has a usable response"));
    }
    let fitted = |i: &usize| region.is_none_or(|r| is_inside(r, ensemble.points.row(*i)));
    let new: Vec<usize> = (first..ensemble.runs.len()).filter(fitted).collect();
    if new.is_empty() {
        return Ok(f64::INFINITY);
    }
    let emulated = emulator.mean(&ensemble.points.select_rows(&new));
    let simulated = ensemble.responses.select_rows(&new);
    let pairs = simulated.as_slice().iter().zip(emulated.as_slice());
    let squares: Vec<f64> = pairs.map(|(a, b)| (a - b).powi(2)).collect();
    Ok(moments::mean(&squares).sqrt())
}

fn is_inside(place: &[(f64, f64)], point: &[f64]) -> bool {
    place.iter().zip(point).all(|(&(low, high), &x)| low <= x && x <= high)
}

/// Parameters with uniform designs in the region.
fn within(parameters: &[Parameter], place: &[(f64, f64)]) -> Vec<Parameter> {
    let narrowed = |(p, &(low, high)): (&Parameter, &(f64, f64))| Parameter {
        design: Distribution::Uniform([low, high]),
        ..p.clone()
    };
    parameters.iter().zip(place).map(narrowed).collect()
}

/// The data with the runs at further points added.
fn extended(
    study: &Study,
    round: usize,
    data: Kept<Data>,
    points: &Matrix,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Data>, Stop> {
    let (Some(simulator), Some(section)) = (Simulator::of(study)?, &study.model) else {
        return Err(Stop::new("the study has no model to run again")
            .help("remove `refine` from `[surrogate]`, or add `[model]`"));
    };
    let stage = folder(round, Stage::Simulate);
    let names: Vec<String> = simulate::names(points.rows())
        .into_iter()
        .map(|name| format!("refined{round}-{name}"))
        .collect();
    let model = (section.built.identity(), &section.common);
    observer.begin("refine", "run", names.len() as u64);
    let asked = simulate::Asked::new(&names, points);
    let made = simulate::kept(study, &simulator, &stage, asked, &model, run, observer)?;
    observer.end("refine", &format!("{} runs near the posterior", names.len()));
    let folder = run.stage_folder(&stage);
    let more = read::ensemble(study, Some(Runs { folder: &folder, made: &made.value }))?;
    let ensemble = data.value.ensemble.map(|first| joined(first, more));
    let value = Data { ensemble, ..data.value };
    let hash = lacuna::run::files::hash(json!([data.hash, made.hash]).to_string().as_bytes());
    Ok(Kept { value, hash, ..data })
}

/// Combines the runs of two ensembles.
fn joined(mut first: Ensemble, second: Ensemble) -> Ensemble {
    for (point, response) in second.points.iter_rows().zip(second.responses.iter_rows()) {
        first.points.push_row(point);
        first.responses.push_row(response);
    }
    first.runs.extend(second.runs);
    first.valid.extend(second.valid);
    first.failed.extend(second.failed);
    first
}
