//! The whole program: stages in order, each one function from plain data to plain data.

pub mod assess;
pub mod best_fit;
pub mod calibrate;
pub mod common_error;
pub mod contents;
pub mod coverage;
pub mod curves;
pub mod derived;
pub mod design;
pub mod direct;
pub mod emulator_error;
pub mod evidence;
pub mod fidelity;
pub mod gap;
pub mod gap_model;
mod idle;
pub mod imports;
pub mod inference_data;
pub mod low_fidelity;
pub mod manifest;
pub mod numerical_error;
pub mod power;
pub mod predict;
pub mod predictions;
pub mod read;
pub mod refine;
pub mod report;
pub mod results;
pub mod sampling;
pub mod screen;
pub mod simulate;
pub mod simulator;
mod start;
pub mod surrogate;
pub mod target;
pub mod validate;

use crate::data::Observations;
use crate::math::random::Stream;
use crate::plugin::{Emulator, Forward};
use crate::report::findings::Findings;
use crate::run::{Kept, Listener, Observer, RunDirectory, Stop, files};
use crate::study::Study;
use crate::study::file::DiscrepancyKeys;
use serde_json::json;
use std::sync::OnceLock;

use calibrate::Calibrated;
use common_error::Allowance;
use evidence::Weighed;
use numerical_error::NumericalError;
use predictions::Predicting;
use read::Data;
use refine::Refinement;
use surrogate::Fitted;

/// What a study is run for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Goal<'a> {
    /// Its posterior.
    Calibrate,
    /// What its model misses too.
    FindGap,
    /// How it fares on what is set aside, against this response of a study without its effects.
    Show(&'a [f64]),
}

/// Runs a study: what is kept and unchanged is taken, the rest is made.
pub fn run(
    study: &Study,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    pursue(study, Goal::Calibrate, run, observer)
}

/// Runs a study and searches for what its model misses.
pub fn find_gap(
    study: &Study,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    if study.target.is_some() {
        return Err(Stop::new("a study with `[target]` has no data that could disagree with it"));
    }
    if study.measurements.is_none() {
        return Err(Stop::new("the study has no `[measurements]` to search for a gap"));
    }
    pursue(study, Goal::FindGap, run, observer)
}

/// Runs a study that had effects added, and compares it on what was set aside with the study without them: with its response
/// `before`, calibrated with the rest.
pub fn show(
    study: &Study,
    before: &[f64],
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    pursue(study, Goal::Show(before), run, observer)
}

fn pursue(
    study: &Study,
    goal: Goal<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    contents::before_all(study)?;
    manifest::begin(study, run)?;
    let observer = &Listener::new(observer);
    let findings = match (&study.target, &study.surrogate) {
        (Some(given), _) => target::run(study, given, run, observer)?,
        (None, Some(_)) => with_surrogate(study, goal, run, observer)?,
        (None, None) => direct::run(study, goal, run, observer)?,
    };
    manifest::end(study, run)?;
    Ok(findings)
}

fn with_surrogate(
    study: &Study,
    goal: Goal<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    let (learned, calibrated) = learn(study, run, observer)?;
    conclude(study, goal, &learned.known(), calibrated.as_ref(), run, observer)
}

/// All stages of a study with a surrogate up to the posterior, which is there when the study has measurements.
pub fn learn(
    study: &Study,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Learned, Option<Kept<Calibrated>>), Stop> {
    let first = prepare(study, run, observer)?;
    refine::stage(study, first, run, observer)
}

/// All stages of a study with a surrogate up to its emulator and what is known of its errors.
pub fn prepare(
    study: &Study,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Learned, Stop> {
    let placed = design::stage(study, run, observer)?;
    let simulated = simulate::stage(study, placed.as_ref(), run, observer)?;
    let data = read::stage(study, simulated.as_ref(), run, observer)?;
    let data = low_fidelity::stage(study, placed.as_ref(), data, run, observer)?;
    let fitting = surrogate::Fitting::of(study, data.value.runs()?)?;
    let fitted = surrogate::stage(study, &data, &fitting, run, observer)?;
    let folders = numerical_error::FOLDERS;
    let numerics = numerical_error::stage(study, &data, None, folders, run, observer)?;
    Learned::new(study, data, fitted, numerics, None)
}

/// Evidence, validation, gap and report of a calibration.
fn conclude(
    study: &Study,
    goal: Goal<'_>,
    known: &Known<'_>,
    calibrated: Option<&Kept<Calibrated>>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    let weighed = weigh(study, known, calibrated, run, observer)?;
    let validated = validate::stage(study, known, calibrated, run, observer)?;
    let made = report::Artifacts {
        known: Some(known),
        calibrated,
        weighed: weighed.as_ref(),
        validated: validated.as_ref(),
        assessed: None,
        gap: None,
    };
    let assessed = assess::stage(study, &made, run, observer)?;
    let made = report::Artifacts { assessed: Some(&assessed), ..made };
    let gap = match goal {
        Goal::FindGap => gap::stage(study, known, run, observer)?,
        // What was found before is not lost in a report that is written again.
        Goal::Calibrate | Goal::Show(_) => gap::kept(study, known, run, observer)?,
    };
    if let Goal::Show(before) = goal {
        gap::show::stage(study, known, calibrated, before, run, observer)?;
    }
    if let Some(calibrated) = calibrated {
        let (weighed, validated) = (weighed.as_ref(), validated.as_ref());
        let finished = inference_data::Finished { calibrated, weighed, validated };
        inference_data::stage(study, known, &finished, run)?;
    }
    report::stage(study, &report::Artifacts { gap: gap.as_ref(), ..made }, run, observer)
}

/// The evidence of a calibration, where there is one.
fn weigh(
    study: &Study,
    known: &Known<'_>,
    calibrated: Option<&Kept<Calibrated>>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<Weighed>>, Stop> {
    let (Some(calibrated), Some(measured)) = (calibrated, &known.data.value.measured) else {
        return Ok(None);
    };
    let parts = calibrate::Parts::of(study, measured, known)?;
    let posterior = parts.posterior(study, known);
    let predicting = Predicting {
        forward: known.forward,
        likelihood: parts.likelihood(),
        law: calibrate::Law::of(study, measured, known)?,
        data: &measured.likelihood,
    };
    evidence::stage(study, &posterior, calibrated, Some(predicting), run, observer).map(Some)
}

/// What is known before the posterior: the data, the emulator and its errors.
pub struct Known<'a> {
    /// The runs and the measurements.
    pub data: &'a Kept<Data>,
    /// From parameters to responses: the emulator, with what is predicted of the numerical error, or the model itself.
    pub forward: &'a dyn Forward,
    /// A hash of what the forward map was made of.
    pub origin: &'a str,
    /// The fitted surrogate with its errors, in a study with a surrogate.
    pub fitted: Option<&'a Kept<Fitted>>,
    /// The emulator of the model as it was run, in a study with a surrogate.
    pub emulator: Option<&'a dyn Emulator>,
    /// The model's numerical error, if the study asks for it.
    pub numerics: Option<&'a Kept<NumericalError>>,
    /// The interval of each parameter in which the emulator was fitted, where that is narrower than the design.
    pub region: Option<&'a [(f64, f64)]>,
    /// How far a refinement came.
    pub refinement: Option<&'a Refinement>,
    /// Which trial the data are of, where they were made and not measured.
    pub trial: Option<Trial>,
    /// The errors of emulator and numerics as these data meet them, once they have been asked for.
    allowances: OnceLock<Vec<Allowance>>,
}

impl Known<'_> {
    /// The errors of emulator and numerics for which the study's likelihood allows, as its data meet them.
    fn allowances(
        &self,
        study: &Study,
        keys: &DiscrepancyKeys,
        data: &Observations,
    ) -> Result<&[Allowance], Stop> {
        if let Some(found) = self.allowances.get() {
            return Ok(found);
        }
        let mut found = Vec::new();
        if let (Some(fitted), true) = (self.fitted, keys.emulator_error) {
            found.push(emulator_error::allowance(study, &fitted.value, data, self.forward)?);
        }
        if let (Some(kept), Some(section)) = (self.numerics, &study.numerical_error) {
            found.push(kept.value.allowance(study, &section.written, data, self.forward)?);
        }
        Ok(self.allowances.get_or_init(|| found))
    }
}

/// One of many calibrations of data that were made: it has random numbers of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Trial {
    /// Its number.
    pub number: u64,
    /// Whether the chains have half of their steps, where the steps of the sampler are draws.
    pub quick: bool,
}

impl Trial {
    /// The random stream of a stage: the study's own where nothing is tried.
    fn stream(trial: Option<Self>, study: &Study, stage: &str) -> Stream {
        match trial {
            None => stream(study, stage),
            Some(trial) => stream(study, "trial").at(trial.number).named(stage),
        }
    }
}

/// What runs and measurements have taught.
pub struct Learned {
    /// The runs and the measurements.
    pub data: Kept<Data>,
    /// The fitted surrogate with its errors.
    pub fitted: Kept<Fitted>,
    /// The model's numerical error, if the study asks for it.
    pub numerics: Option<Kept<NumericalError>>,
    /// The emulator.
    pub emulator: Box<dyn Emulator>,
    /// The emulator with what is predicted of the numerical error, where anything is.
    pub corrected: Option<Box<dyn Emulator>>,
    /// A hash of what the forward map was made of.
    pub origin: String,
    /// See [`Known::region`].
    pub region: Option<Vec<(f64, f64)>>,
    /// How far a refinement came, where the study asks for one.
    pub refinement: Option<Refinement>,
    /// See [`Known::trial`].
    pub trial: Option<Trial>,
}

impl Learned {
    /// Of a study's runs, the emulator made of them and the model's numerical error.
    fn new(
        study: &Study,
        data: Kept<Data>,
        (fitted, emulator): (Kept<Fitted>, Box<dyn Emulator>),
        numerics: Option<Kept<NumericalError>>,
        trial: Option<Trial>,
    ) -> Result<Self, Stop> {
        let corrected = match &numerics {
            Some(numerics) => numerics.value.corrected(study, &fitted.value)?,
            None => None,
        };
        let section = study.numerical_error.as_ref();
        let origin = match (&corrected, &numerics, section) {
            (Some(_), Some(numerics), Some(section)) => {
                let of = json!([fitted.hash, numerics.hash, section.written.whole()]);
                files::hash(of.to_string().as_bytes())
            }
            _ => fitted.hash.clone(),
        };
        let (region, refinement) = (None, None);
        Ok(Self { data, fitted, numerics, emulator, corrected, origin, region, refinement, trial })
    }

    /// The same as it is handed on.
    pub fn known(&self) -> Known<'_> {
        Known {
            data: &self.data,
            forward: self.corrected.as_deref().map_or(&*self.emulator as &dyn Forward, |c| c),
            origin: &self.origin,
            fitted: Some(&self.fitted),
            emulator: Some(&*self.emulator),
            numerics: self.numerics.as_ref(),
            region: self.region.as_deref(),
            refinement: self.refinement.as_ref(),
            trial: self.trial,
            allowances: OnceLock::new(),
        }
    }
}

/// The random stream of a stage.
fn stream(study: &Study, stage: &str) -> Stream {
    Stream::root(study.about.seed).named(stage)
}
