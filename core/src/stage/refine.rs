//! Calibration and sequential refinement: further runs where posterior and emulator's error are large.
//!
//! Each round chooses new points one after the other among draws of the posterior and an even cover of the region, by
//! the largest product of the emulator's error there and the distance from all runs (a weighted maximin rule after
//! Johnson, Moore and Ylvisaker, J. Stat. Plan. Inference 26 (1990) 131); runs them; fits the surrogate to
//! the runs in the region; and calibrates anew.

mod choose;

use serde_json::json;

use crate::data::{Draws, Ensemble, Parameter};
use crate::linalg::Matrix;
use crate::math::distribution::Distribution;
use crate::math::moments;
use crate::plugin::Emulator;
use crate::run::{Kept, Observer, RunDirectory, Stop};
use crate::study::Study;
use crate::study::file::{Refine, Region};

use super::calibrate::{self, Calibrated, Parts};
use super::numerical_error::{self, NumericalError};
use super::read::{self, Data, Runs};
use super::simulator::Simulator;
use super::surrogate::{self, Fitting};
use super::{Learned, Trial, simulate};

/// An interval of each parameter.
type Intervals = Vec<(f64, f64)>;

/// Calibrates, and refines as long as the study asks for it and it is needed.
pub fn stage(
    study: &Study,
    mut learned: Learned,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Learned, Option<Kept<Calibrated>>), Stop> {
    let first = calibrate::stage(study, &learned.known(), "5-calibrate", run, observer)?;
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
        let folder = folder(round, "calibrate");
        let again = calibrate::stage(study, &learned.known(), &folder, run, observer)?;
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

fn folder(round: usize, what: &str) -> String {
    format!("5-refine-{round}-{what}")
}

/// How far a refinement came.
#[derive(Debug, Clone, PartialEq)]
pub struct Refinement {
    /// The number of rounds.
    pub rounds: usize,
    /// The error that the emulator had at the last new runs, before it learned from them, over the discrepancy: root
    /// mean squares over the outputs.
    pub ratio: f64,
    /// The ratio that the study asks for.
    pub until: f64,
    /// Whether the posterior keeps clear of the region's own edges.
    pub clear: bool,
    /// Whether the ratio is as small as the study wants, and the posterior clear of the region's edges.
    pub reached: bool,
}

impl Refinement {
    fn summary(&self, refine: &Refine) -> String {
        let edge = if self.clear { "" } else { ", and the posterior meets the edge of the region" };
        let (rounds, until) = (self.rounds, refine.until.get());
        if self.ratio.is_infinite() {
            return format!(
                "after {rounds} rounds of refinement the region moved away from the runs{edge}"
            );
        }
        let ratio = self.ratio;
        format!(
            "after {rounds} rounds of refinement the emulator's error at new runs is {ratio:.3} of the discrepancy (wanted: {until}){edge}"
        )
    }
}

fn kept(calibrated: &Kept<Calibrated>) -> Draws {
    calibrated.value.draws.from_step(calibrated.value.outcome.burn_in)
}

/// The variance of the discrepancy at the best fit, mean over the outputs, without what emulator and numerics add.
fn data_variance(
    study: &Study,
    learned: &Learned,
    calibrated: &Kept<Calibrated>,
) -> Result<f64, Stop> {
    let known = learned.known();
    let Some(measured) = &learned.data.value.measured else {
        return Err(Stop::new("the study has no measurements"));
    };
    let parts = Parts::of(study, measured, &known)?;
    let map = &calibrated.value.outcome.map;
    let d = study.parameters.len();
    let own = parts.likelihood().hyperparameters().len();
    let mean = learned.emulator.mean(&Matrix::from_vec(1, d, map[..d].to_vec()));
    let spread = parts.likelihood().predictive(mean.row(0), &map[map.len() - own..]);
    let of_data = spread.iter().filter(|p| p.origin != "emulator" && p.origin != "numerics");
    Ok(of_data.map(|part| moments::mean(&part.variance)).sum())
}

/// The middle 99.8 % of each parameter's draws.
fn middle(draws: &Draws, parameters: usize) -> Intervals {
    let ends = |j: usize| {
        let sorted = moments::sorted(&draws.pooled(j));
        (moments::quantile(&sorted, 0.001), moments::quantile(&sorted, 0.999))
    };
    (0..parameters).map(ends).collect()
}

/// The bounds that no region leaves: those of design and prior.
fn bounds(parameter: &Parameter) -> (f64, f64) {
    let (design, prior) = (parameter.design.support(), parameter.prior.support());
    (design.0.max(prior.0), design.1.min(prior.1))
}

/// Whether the posterior stays inside the region, but for edges that are those of prior or design.
fn is_clear(study: &Study, region: Option<&[(f64, f64)]>, draws: &Draws) -> bool {
    let Some(region) = region else { return true };
    let middle = middle(draws, region.len());
    study.parameters.iter().zip(region).zip(middle).all(|((p, &(low, high)), (from, to))| {
        let (lowest, highest) = bounds(p);
        let margin = 0.05 * (high - low);
        (low <= lowest || from > low + margin) && (high >= highest || to < high - margin)
    })
}

/// A box about the posterior: at least twice as wide as its middle, and as the range of the prior halved so often.
///
/// A posterior through a poor emulator is no guide to a small region, however narrow it is.
fn about(study: &Study, draws: &Draws, halvings: i32) -> Intervals {
    let middle = middle(draws, study.parameters.len());
    let boxed = |(p, (from, to)): (&Parameter, (f64, f64))| {
        let (lowest, highest) = bounds(p);
        let tails = [0.001, 0.999].map(|q| p.prior.quantile(q));
        let range = highest.min(tails[1]) - lowest.max(tails[0]);
        let half = (to - from).max(0.5 * range * 0.5_f64.powi(halvings));
        let (low, high) = (0.5 * (from + to) - half, 0.5 * (from + to) + half);
        // Moved inside the bounds as a whole, then cut where it is wider than they are.
        let shift = (lowest - low).max(0.0) - (high - highest).max(0.0);
        ((low + shift).max(lowest), (high + shift).min(highest))
    };
    study.parameters.iter().zip(middle).map(boxed).collect()
}

/// One round: new runs, and the surrogate fitted anew. Also the root mean square error that the emulator had at the new
/// runs.
#[expect(clippy::too_many_arguments, reason = "what a round starts from, and where it works")]
fn next(
    study: &Study,
    refine: &Refine,
    round: usize,
    learned: Learned,
    calibrated: &Kept<Calibrated>,
    place: Intervals,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Learned, f64), Stop> {
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
            folder: &folder(round, "surrogate"),
            parameters: &study.parameters,
            training: all.collect(),
            validation: Vec::new(),
        },
        Region::Posterior => {
            parameters = within(&study.parameters, &place);
            let inside = |i: &usize| is_inside(&place, ensemble.points.row(*i));
            Fitting {
                folder: &folder(round, "surrogate"),
                parameters: &parameters,
                training: all.filter(inside).collect(),
                validation: Vec::new(),
            }
        }
    };
    let (fitted, emulator) = surrogate::stage(study, &data, &fitting, run, observer)?;
    let stays = learned.numerics.as_ref().is_some_and(|kept| holds(&kept.value, &place));
    let numerics = if round == 1 || !stays {
        // The first runs about the posterior tell more of its numerical error than those of the design; and where the
        // region has left theirs, what they tell does not hold.
        let [finer, folder] = ["simulate-finer", "numerical-error"].map(|what| folder(round, what));
        let folders = [finer.as_str(), folder.as_str()];
        numerical_error::stage(study, &data, Some(&place), folders, run, observer)?
    } else {
        learned.numerics
    };
    let region = (refine.region == Region::Posterior).then_some(place);
    let again = Learned::new(study, data, (fitted, emulator), numerics)?;
    Ok((Learned { region, trial, ..again }, error))
}

/// Whether what was learned of the numerical error holds in all of a region.
fn holds(numerics: &NumericalError, place: &[(f64, f64)]) -> bool {
    let inside = |(&(low, high), &(a, b)): (&(f64, f64), &(f64, f64))| low <= a && b <= high;
    numerics.region.as_ref().is_none_or(|region| region.iter().zip(place).all(inside))
}

/// The root mean square error of an emulator at the runs from `first` on that lie where it was fitted; infinite when
/// there are none.
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

/// The parameters with uniform designs in the region.
fn within(parameters: &[Parameter], place: &[(f64, f64)]) -> Vec<Parameter> {
    let narrowed = |(p, &(low, high)): (&Parameter, &(f64, f64))| Parameter {
        design: Distribution::Uniform([low, high]),
        ..p.clone()
    };
    parameters.iter().zip(place).map(narrowed).collect()
}

/// The data with the runs at further points.
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
            .help("take `refine` out of `[surrogate]`, or add `[model]`"));
    };
    let stage = folder(round, "simulate");
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
    let hash = crate::run::files::hash(json!([data.hash, made.hash]).to_string().as_bytes());
    Ok(Kept { value, hash, ..data })
}

/// The runs of both.
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
