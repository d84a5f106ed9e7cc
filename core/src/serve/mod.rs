//! What a study knows, as functions of its unknowns, for programs that ask from outside.
//!
//! - `model`: the study's simulator, from the parameters to the response;
//! - `emulator`: the surrogate of a finished run, likewise;
//! - `posterior`: the log density of parameters and hyperparameters given the measurements of a finished run, or of
//!   a study with a target.
//!
//! All in the study's units.

mod curvature;
mod emulated;
mod finished;
mod posterior;
mod simulated;
#[cfg(test)]
mod tests;
mod watched;

use std::ops::Range;

use crate::data::Unit;
use crate::linalg::Matrix;
use crate::plugin::Density;
use crate::plugin::model::EvalError;
use crate::plugin::registry::{NoKeys, Section};
use crate::posterior::{Given, Posterior};
use crate::run::{Observer, RunDirectory, Stop};
use crate::stage::calibrate::Parts;
use crate::stage::direct::Prepared;
use crate::stage::{self, Known};
use crate::study::Study;

pub use curvature::curvature;
pub use finished::finished;

use emulated::Emulated;
use posterior::LogPosterior;
use simulated::Simulated;
use watched::Watched;

/// A function of a study's unknowns.
pub trait Function: Sync {
    /// What it is called: `model`, `emulator`, `posterior`.
    fn name(&self) -> &'static str;

    /// What goes in, in this order.
    fn variables(&self) -> Vec<Variable>;

    /// How many values come out.
    fn outputs(&self) -> usize;

    /// The scenarios that it can be asked for one at a time, with their outputs; none where it answers as a whole.
    fn scenarios(&self) -> &[Part] {
        &[]
    }

    /// The values at a point: all of them, or those of the scenario of this number.
    fn values(&self, point: &[f64], scenario: Option<usize>) -> Result<Vec<f64>, EvalError>;

    /// Its derivatives, where they are known exactly.
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        None
    }
}

/// Exact derivatives of a function.
pub trait Derivatives: Sync {
    /// The derivative of each value (rows) by each variable (columns), of all values or of one scenario's.
    fn jacobian(&self, point: &[f64], scenario: Option<usize>) -> Result<Matrix, EvalError>;

    /// For each variable the size of a change that matters, where the function is smooth enough for differences of
    /// its derivatives; `None` where it is not.
    fn scales(&self) -> Option<Vec<f64>>;
}

/// A scenario's share of the values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// The scenario.
    pub scenario: String,
    /// Its values among those of all.
    pub outputs: Range<usize>,
}

/// What a function depends on.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
}

/// Hands over the functions that there are: those of the study, and those of its finished run, if there is one. Each
/// answers nothing any more once a plugin of the study has a fault.
pub fn functions<R>(
    study: &Study,
    run: Option<RunDirectory>,
    observer: &dyn Observer,
    act: impl FnOnce(&[&dyn Function]) -> R,
) -> Result<R, Stop> {
    let faults = study.faults();
    unwatched(study, run, observer, |all| {
        let watched: Vec<Watched<'_>> =
            all.iter().map(|function| Watched::new(*function, &faults)).collect();
        let all: Vec<&dyn Function> = watched.iter().map(|function| function as _).collect();
        act(&all)
    })
}

fn unwatched<R>(
    study: &Study,
    run: Option<RunDirectory>,
    observer: &dyn Observer,
    act: impl FnOnce(&[&dyn Function]) -> R,
) -> Result<R, Stop> {
    if let Some(target) = &study.target {
        return of_target(study, target, act);
    }
    let simulated = Simulated::of(study)?;
    let Some(mut run) = run else {
        let model = simulated.as_ref().ok_or_else(nothing)?;
        return Ok(act(&[model]));
    };
    if study.surrogate.is_none() {
        let prepared = Prepared::of(study, &mut run, observer)?;
        drop(run);
        return of_run(study, simulated.as_ref(), &prepared.known(), act);
    }
    // All of it is kept.
    let (learned, _) = stage::learn(study, &mut run, observer)?;
    // Others may use the folder while the functions are served from memory.
    drop(run);
    of_run(study, simulated.as_ref(), &learned.known(), act)
}

fn nothing() -> Stop {
    Stop::new("the study has no model and no finished run, so that there is nothing to ask")
        .help("run the study first, or name its run directory with `--out DIR`")
}

fn of_target<R>(
    study: &Study,
    target: &Section<dyn Density, NoKeys>,
    act: impl FnOnce(&[&dyn Function]) -> R,
) -> Result<R, Stop> {
    let density = target.built.plugin.bind(&study.parameters)?;
    let likelihood = if target.built.plugin.includes_prior() {
        Given::posterior(&*density, &study.parameters)
    } else {
        Given::likelihood(&*density)
    };
    let posterior = LogPosterior::of(Posterior::new(&study.parameters, likelihood));
    Ok(act(&[&posterior]))
}

/// The model and the emulator where there is one, and the posterior where there are measurements.
fn of_run<R>(
    study: &Study,
    simulated: Option<&Simulated<'_>>,
    known: &Known<'_>,
    act: impl FnOnce(&[&dyn Function]) -> R,
) -> Result<R, Stop> {
    let emulator = Emulated::of(study, known);
    let mut all: Vec<&dyn Function> = Vec::new();
    if let Some(model) = simulated {
        all.push(model);
    }
    if let Some(emulator) = &emulator {
        all.push(emulator);
    }
    let (Some(measured), Some(_)) = (&known.data.value.measured, &study.discrepancy) else {
        return Ok(act(&all));
    };
    let parts = Parts::of(study, measured, known)?;
    let posterior = LogPosterior::of(parts.posterior(study, known));
    all.push(&posterior);
    Ok(act(&all))
}

/// The names and units of a study's parameters.
fn parameters(study: &Study) -> Vec<Variable> {
    let variable =
        |p: &crate::data::Parameter| Variable { name: p.name.clone(), unit: p.unit.clone() };
    study.parameters.iter().map(variable).collect()
}

/// The scenarios of a study; none where it has but the one that has no name.
fn parts(study: &Study) -> Vec<Part> {
    let named = study.scenarios.iter().filter(|scenario| !scenario.name.is_empty());
    let part = |name: &String| {
        let (_, outputs) = study.layouts.of_scenario(name)?;
        Some(Part { scenario: name.clone(), outputs })
    };
    named.filter_map(|scenario| part(&scenario.name)).collect()
}
