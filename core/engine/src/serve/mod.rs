//! A study as functions of its unknowns, for other programs to call.
//!
//! - `model`: the study's simulator, from the parameters to the response;
//! - `emulator`: the surrogate of a finished run, from the parameters to the response;
//! - `replicate`: from all unknowns to the response with the study's effects, and new replicates around it; for programs
//!   in the same process alone;
//! - `posterior`: the log density of parameters and hyperparameters given the measurements of a finished run, or of a
//!   study with a target.
//!
//! All values are in the study's units.

mod curvature;
mod emulated;
mod exported;
mod finished;
mod posterior;
mod replicated;
mod simulated;
#[cfg(test)]
mod tests;
mod watched;

use std::ops::Range;

use lacuna::data::Unit;
use lacuna::plugin::Density;
use lacuna::plugin::model::EvalError;
use lacuna::plugin::registry::{NoKeys, Section};
use lacuna::run::{Observer, Stop};
use lacuna_linalg::Matrix;
use lacuna_run::RunDirectory;
use rayon::prelude::*;

use crate::pipeline;
use crate::posterior::{Given, Posterior};
use crate::stage::calibrate::Parts;
use crate::stage::direct::Direct;
use crate::stage::inverse_problem::InverseProblem;
use crate::study::Study;
use emulated::Emulated;
use posterior::LogPosterior;
use replicated::Replicated;
use simulated::Simulated;
use watched::Watched;

pub use curvature::curvature;
pub use exported::export;
pub use finished::finished;

/// A function of a study's unknowns.
pub trait Function: Sync {
    /// Name of the function: `model`, `emulator`, `posterior`.
    fn name(&self) -> &'static str;

    /// Variables, in the order of the coordinates of a point.
    fn variables(&self) -> Vec<Variable>;

    /// Number of values.
    fn outputs(&self) -> usize;

    /// Scenarios that can be evaluated separately, with their outputs; empty if the function can only be evaluated as a
    /// whole.
    fn scenarios(&self) -> &[Part] {
        &[]
    }

    /// Values at a point: all of them, or those of the scenario with this index.
    fn values(&self, point: &[f64], scenario: Option<usize>) -> Result<Vec<f64>, EvalError>;

    /// All values at each point, `points x values`; NaN at a point where the function has no values.
    fn batch(&self, points: &Matrix) -> Result<Matrix, EvalError> {
        let row = |point: &[f64]| match self.values(point, None) {
            Err(EvalError::Rejected(_)) => Ok(vec![f64::NAN; self.outputs()]),
            answered => answered,
        };
        let all: Vec<&[f64]> = points.iter_rows().collect();
        let rows: Vec<Vec<f64>> = all.into_par_iter().map(row).collect::<Result<_, _>>()?;
        Ok(Matrix::from_rows(self.outputs(), rows))
    }

    /// Standard deviation of the error of each value at each point, `points x values`, if it is known.
    fn deviations(&self, _points: &Matrix) -> Option<Matrix> {
        None
    }

    /// A new replicate at each point, `points x values`, with random numbers of this seed, if the function has any.
    fn replicates(&self, _points: &Matrix, _seed: u64) -> Result<Option<Matrix>, EvalError> {
        Ok(None)
    }

    /// True if the function is of use in this process alone.
    fn is_local(&self) -> bool {
        false
    }

    /// Derivatives of the function, if they are known exactly.
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        None
    }
}

/// Exact derivatives of a function.
pub trait Derivatives: Sync {
    /// Derivative of each value by each variable (`values x variables`), of all values or of those of one scenario.
    fn jacobian(&self, point: &[f64], scenario: Option<usize>) -> Result<Matrix, EvalError>;

    /// For each variable the size of a significant change, if the function is smooth enough for finite differences of
    /// its derivatives; `None` otherwise.
    fn scales(&self) -> Option<Vec<f64>>;
}

/// Values that belong to a scenario.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// Name of the scenario.
    pub scenario: String,
    /// Range of its values among those of all scenarios.
    pub outputs: Range<usize>,
}

/// A variable of a function.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Name of the variable.
    pub name: String,
    /// Unit of the variable.
    pub unit: Unit,
}

/// Passes on the available functions: those of the study, and those of its finished run, if there is one. After a fault
/// of one of the study's plugins the functions return errors.
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
        let prepared = Direct::of(study, &mut run, observer)?;
        drop(run);
        return of_run(study, simulated.as_ref(), &prepared.problem(), act);
    }
    // All stages are kept, so they are only read.
    let (learned, _) = pipeline::calibrate_emulated(study, &mut run, observer)?;
    // Others may use the folder while the functions are served from memory.
    drop(run);
    of_run(study, simulated.as_ref(), &learned.problem(), act)
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
        Given::posterior(&*density, study.prior())
    } else {
        Given::likelihood(&*density)
    };
    let posterior = LogPosterior::of(Posterior::new(study.prior(), likelihood));
    Ok(act(&[&posterior]))
}

/// The model and the emulator, if there is one, and the posterior, if there are measurements.
fn of_run<R>(
    study: &Study,
    simulated: Option<&Simulated<'_>>,
    problem: &InverseProblem<'_>,
    act: impl FnOnce(&[&dyn Function]) -> R,
) -> Result<R, Stop> {
    let emulator = Emulated::of(study, problem)?;
    let mut all: Vec<&dyn Function> = Vec::new();
    if let Some(model) = simulated {
        all.push(model);
    }
    if let Some(emulator) = &emulator {
        all.push(emulator);
    }
    // The draws of a cut distribution have no common density, and an estimated one has no derivatives.
    let dense = study.cut().is_empty() && !study.is_stochastic();
    let measured = problem.data.value.measured.as_ref().filter(|_| dense);
    let (Some(measured), Some(_)) = (measured, &study.discrepancy) else {
        return Ok(act(&all));
    };
    let parts = Parts::of(study, measured, problem)?;
    let posterior = LogPosterior::of(parts.posterior(study, problem));
    let law = Parts::predicting(study, measured, problem)?;
    let replicate = Replicated::new(study, problem.forward(), law, posterior.variables());
    all.push(&replicate);
    // With populations the log density of the members themselves has no maximum, and no coordinates are those of others.
    if study.has_populations() {
        return Ok(act(&all));
    }
    all.push(&posterior);
    Ok(act(&all))
}

/// Names and units of a study's parameters.
fn parameters(study: &Study) -> Vec<Variable> {
    let variable =
        |p: &lacuna::data::Parameter| Variable { name: p.name.clone(), unit: p.unit.clone() };
    study.parameters.iter().map(variable).collect()
}

/// Scenarios of a study; empty if it has only the unnamed one.
fn parts(study: &Study) -> Vec<Part> {
    let named = study.scenarios.iter().filter(|scenario| !scenario.name.is_empty());
    let part = |name: &String| {
        let (_, outputs) = study.layouts.of_scenario(name)?;
        Some(Part { scenario: name.clone(), outputs })
    };
    named.filter_map(|scenario| part(&scenario.name)).collect()
}
