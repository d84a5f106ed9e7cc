//! Calibration with sequential refinement: further runs where posterior density and emulator error are large.
//!
//! Each round chooses new points one after the other among draws of the posterior and an even cover of the region, by
//! the largest product of the emulator's error there and the distance from all runs (a weighted maximin rule after
//! Johnson, Moore and Ylvisaker, J. Stat. Plan. Inference 26 (1990) 131); runs them; fits the surrogate to the runs in
//! the region; and calibrates again.

mod choose;
mod variance;

use lacuna::data::{Draws, Ensemble, Parameter};
use lacuna::math::moments;
use lacuna::plugin::Emulator;
use lacuna::plugin::discrepancy::ErrorOrigin;
use lacuna::run::{Observer, Stop};
use lacuna_linalg::Matrix;
use lacuna_run::{Folder, Kept, RunDirectory, Stage};

use super::calibrate::{self, Calibrated, Parts};
use super::more_runs::{Intervals, More, bounds, is_inside, within};
use super::numerical_error::{self, NumericalError};
use super::surrogate::{self, Fitting, Purpose};
use crate::stage::emulated::Emulated;
use crate::stage::inverse_problem::Trial;
use crate::study::Study;
use crate::study::file::{Choose, Refine, Region};
use choose::Sought;

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
    let base = learned.region.clone().unwrap_or_else(|| prior_range(study));
    let mut halvings = 0;
    for round in 1..=refine.rounds.get() {
        let noise = Noise::of(study, refine, &learned, &calibrated)?;
        halvings += i32::from(is_clear(study, learned.region.as_deref(), &kept(&calibrated)));
        let place = about(study, &kept(&calibrated), &base, halvings);
        let (again, error) = next(
            study,
            refine,
            round,
            learned,
            &calibrated,
            (place, &noise.of_mean),
            run,
            observer,
        )?;
        learned = again;
        let folder = folder(round, Stage::Calibrate);
        let again = calibrate::stage(study, &learned.problem(), &folder, run, observer)?;
        calibrated = again.ok_or_else(|| Stop::new("the study has no measurements"))?;
        let ratio = error / noise.scale;
        let clear = is_clear(study, learned.region.as_deref(), &kept(&calibrated));
        let reached = ratio <= refine.until.get() && clear;
        let until = refine.until.get();
        let of = refine.choose.measured_by();
        let refinement = Refinement { rounds: round, ratio, of, until, clear, reached };
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
    /// Name of the size that the error is compared with.
    pub of: &'static str,
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
        let Self { ratio, of, .. } = self;
        format!(
            "after {rounds} rounds of refinement the emulator's error at new runs is {ratio:.3} of {of} (requested: \
             {until}){edge}"
        )
    }
}

fn kept(calibrated: &Kept<Calibrated>) -> Draws {
    calibrated.value.draws.from_step(calibrated.value.outcome.burn_in)
}

impl Choose {
    /// Name of the size that the emulator's error is compared with.
    fn measured_by(self) -> &'static str {
        match self {
            Self::EmulatorError => "the discrepancy",
            Self::PosteriorVariance => "the discrepancy of the replicates' mean",
        }
    }
}

/// Discrepancy at the best fit, without the errors of emulator and numerics.
struct Noise {
    /// Variance of the mean of the replicates for each output, NaN where nothing was measured.
    of_mean: Vec<f64>,
    /// Size that the emulator's error is compared with: a root mean square over the outputs.
    scale: f64,
}

impl Noise {
    fn of(
        study: &Study,
        refine: &Refine,
        learned: &Emulated,
        calibrated: &Kept<Calibrated>,
    ) -> Result<Self, Stop> {
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
        let of_data = || spread.iter().filter(|part| !errors.contains(&part.origin));
        let counts = measured.likelihood.summaries();
        let of_output = |(i, count): (usize, f64)| {
            let one: f64 = of_data().map(|part| part.variance[i]).sum();
            if count > 0.0 { one / count } else { f64::NAN }
        };
        let counts = counts.iter().map(|summary| summary.count as f64).enumerate();
        let of_mean: Vec<f64> = counts.map(of_output).collect();
        let scale = match refine.choose {
            Choose::EmulatorError => of_data().map(|part| moments::mean(&part.variance)).sum(),
            Choose::PosteriorVariance => {
                let known = of_mean.iter().copied().filter(|v| v.is_finite());
                moments::mean(&known.collect::<Vec<f64>>())
            }
        };
        Ok(Self { of_mean, scale: f64::sqrt(scale) })
    }
}

/// Central 99.8 % interval of each parameter's draws.
fn middle(draws: &Draws, parameters: usize) -> Intervals {
    let ends = |j: usize| {
        let sorted = moments::sorted(&draws.pooled(j));
        (moments::quantile(&sorted, 0.001), moments::quantile(&sorted, 0.999))
    };
    (0..parameters).map(ends).collect()
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

/// Central 99.8 % of each prior inside the bounds.
fn prior_range(study: &Study) -> Intervals {
    let range = |p: &Parameter| {
        let (lowest, highest) = bounds(p);
        let tails = [0.001, 0.999].map(|q| p.prior.quantile(q));
        (lowest.max(tails[0]), highest.min(tails[1]))
    };
    study.parameters.iter().map(range).collect()
}

/// A box around the posterior: at least twice as wide as its central interval, and as the `base` (the range of the prior,
/// or the region of a sequential design) divided by `2^halvings`.
///
/// A posterior from a poor emulator does not justify a small region, however narrow it is.
fn about(study: &Study, draws: &Draws, base: &[(f64, f64)], halvings: i32) -> Intervals {
    let middle = middle(draws, study.parameters.len());
    let boxed = |(j, p): (usize, &Parameter)| {
        let ((from, to), (first, last)) = (middle[j], base[j]);
        let (lowest, highest) = bounds(p);
        let half = (to - from).max(0.5 * (last - first) * 0.5_f64.powi(halvings));
        let (low, high) = (0.5 * (from + to) - half, 0.5 * (from + to) + half);
        // Shift the interval inside the bounds, then cut it if it is wider than they are.
        let shift = (lowest - low).max(0.0) - (high - highest).max(0.0);
        ((low + shift).max(lowest), (high + shift).min(highest))
    };
    study.parameters.iter().enumerate().map(boxed).collect()
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
    (place, noise): (Intervals, &[f64]),
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Emulated, f64), Stop> {
    let draws = kept(calibrated);
    let trial = learned.trial;
    let random = Trial::stream(trial, study, "refine").at(round as u64);
    let sought =
        Sought { learned: &learned, draws: &draws, place: &place, count: refine.runs.get() };
    let by_variance = match refine.choose {
        Choose::PosteriorVariance => variance::points(&sought, noise, &random)?,
        Choose::EmulatorError => None,
    };
    let points = if let Some(points) = by_variance {
        points
    } else {
        if refine.choose == Choose::PosteriorVariance {
            observer.warn(
                "the surrogate does not know the covariance of its errors, or they are negligible: the points of \
                 this round are chosen as by `emulator_error`",
            );
        }
        choose::points(&sought, &random)?
    };
    let before = learned.data.value.runs()?.runs.len();
    let more = More {
        folder: folder(round, Stage::Simulate),
        prefix: &format!("refined{round}"),
        points: &points,
        may_fail: false,
    };
    let data = more.added(study, learned.data, run, observer)?;
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
    let mut again = Emulated::new(study, data, (fitted, emulator), numerics, trial)?;
    again.region = region;
    Ok((again, error))
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
