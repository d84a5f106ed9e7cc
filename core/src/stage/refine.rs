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
use crate::plugin::reader::EnsembleSource;
use crate::run::{Kept, Observer, RunDirectory, Stop};
use crate::study::Study;
use crate::study::file::{Refine, Region};

use super::calibrate::{self, Calibrated, Parts};
use super::numerical_error::NumericalError;
use super::read::{self, Data};
use super::simulator::Simulator;
use super::surrogate::{self, Fitting};
use super::{Learned, simulate, stream};

/// An interval of each parameter.
type Intervals = Vec<(f64, f64)>;

/// Calibrates, and refines as long as the study asks for it and it is needed.
pub fn stage(
    study: &Study,
    mut learned: Learned,
    numerics: Option<&Kept<NumericalError>>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Learned, Option<Kept<Calibrated>>), Stop> {
    let first = calibrate::stage(study, &learned.with(numerics), "5-calibrate", run, observer)?;
    let refine = study.surrogate.as_ref().and_then(|s| s.common.refine.as_ref());
    let (Some(refine), Some(mut calibrated)) = (refine, first.clone()) else {
        return Ok((learned, first));
    };
    let most = refine.rounds.get();
    for round in 1..=most + 1 {
        observer.begin("refine", "round", most as u64);
        let state = State::of(study, &learned, numerics, &calibrated)?;
        observer.end("refine", &state.summary(round - 1, refine));
        let reached = state.is_reached(refine);
        learned.refinement = Some(Refinement { rounds: round - 1, ratio: state.ratio, reached });
        if reached {
            break;
        }
        if round > most {
            observer.warn(&format!("{}; allow more `rounds`", state.summary(most, refine)));
            break;
        }
        learned = next(study, refine, round, learned, &calibrated, run, observer)?;
        let folder = folder(round, "calibrate");
        let known = learned.with(numerics);
        let again = calibrate::stage(study, &known, &folder, run, observer)?;
        calibrated = again.ok_or_else(|| Stop::new("the study has no measurements"))?;
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
    /// The emulator's error near the posterior over the discrepancy, root mean squares over the outputs.
    pub ratio: f64,
    /// Whether that is as small as the study wants, and the posterior clear of the region's edges.
    pub reached: bool,
}

/// How far a refinement has come.
struct State {
    /// The emulator's error over the discrepancy, root mean squares over the outputs.
    ratio: f64,
    /// Whether the posterior keeps clear of the region's own edges.
    clear: bool,
}

impl State {
    fn of(
        study: &Study,
        learned: &Learned,
        numerics: Option<&Kept<NumericalError>>,
        calibrated: &Kept<Calibrated>,
    ) -> Result<Self, Stop> {
        let known = learned.with(numerics);
        let Some(measured) = &learned.data.value.measured else {
            return Err(Stop::new("the study has no measurements"));
        };
        let parts = Parts::of(study, measured, &known)?;
        let map = &calibrated.value.outcome.map;
        let d = study.parameters.len();
        let own = parts.likelihood().hyperparameters().len();
        let mean = learned.emulator.mean(&Matrix::from_vec(1, d, map[..d].to_vec()));
        let spread = parts.likelihood().predictive(mean.row(0), &map[map.len() - own..]);
        let of_data = |origin: &str| origin != "emulator" && origin != "numerics";
        let data: f64 = spread
            .iter()
            .filter(|part| of_data(&part.origin))
            .map(|part| moments::mean(&part.variance))
            .sum();
        let stated = calibrate::stated_variance(study, &measured.likelihood, &*learned.emulator)?;
        let factor = learned.fitted.value.covariance(study, stated.as_deref())?.factor;
        let squares: f64 = factor.as_slice().iter().map(|f| f * f).sum();
        let ratio = (squares / factor.rows() as f64 / data).sqrt();
        let draws = calibrated.value.draws.from_step(calibrated.value.outcome.burn_in);
        Ok(Self { ratio, clear: is_clear(study, learned.region.as_deref(), &draws) })
    }

    fn is_reached(&self, refine: &Refine) -> bool {
        self.ratio <= refine.until.get() && self.clear
    }

    fn summary(&self, rounds: usize, refine: &Refine) -> String {
        let edge = if self.clear { "" } else { ", and the posterior meets the edge of the region" };
        format!(
            "after {rounds} rounds of refinement the emulator's error is {:.3} of the discrepancy (wanted: {}){edge}",
            self.ratio,
            refine.until.get()
        )
    }
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

/// A box about the posterior, twice as wide as its middle.
fn about(study: &Study, draws: &Draws) -> Intervals {
    let middle = middle(draws, study.parameters.len());
    let widened = |(p, (from, to)): (&Parameter, (f64, f64))| {
        let ((lowest, highest), half) = (bounds(p), 0.5 * (to - from));
        ((from - half).max(lowest), (to + half).min(highest))
    };
    study.parameters.iter().zip(middle).map(widened).collect()
}

/// One round: new runs, and the surrogate fitted anew.
fn next(
    study: &Study,
    refine: &Refine,
    round: usize,
    learned: Learned,
    calibrated: &Kept<Calibrated>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Learned, Stop> {
    let outcome = &calibrated.value.outcome;
    let draws = calibrated.value.draws.from_step(outcome.burn_in);
    let place = about(study, &draws);
    let random = stream(study, "refine").at(round as u64);
    let points = choose::points(&learned, &draws, &place, refine.runs.get(), &random);
    let data = extended(study, round, learned.data, &points, run, observer)?;
    let ensemble = &data.value.ensemble;
    let parameters: Vec<Parameter>;
    let all = 0..ensemble.runs.len();
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
    let region = (refine.region == Region::Posterior).then_some(place);
    Ok(Learned { data, fitted, emulator, region, refinement: None })
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
    let model = (section.built.name, &section.built.options, &section.common);
    observer.begin("refine", "run", names.len() as u64);
    let made = simulate::kept(study, &simulator, &stage, &names, points, &model, run, observer)?;
    observer.end("refine", &format!("{} runs near the posterior", names.len()));
    let folder = run.stage_folder(&stage);
    let source = EnsembleSource {
        directory: &study.directory,
        simulated: Some(&folder),
        parameters: &study.parameters,
        layout: &study.layout,
    };
    let more = read::from_files(study, &source)?;
    let Data { ensemble, measured } = data.value;
    let value = Data { ensemble: joined(ensemble, more), measured };
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
