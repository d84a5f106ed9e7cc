//! Derivatives of the response at the training runs, for a surrogate that is fitted to them as well.
//!
//! They are further calls of the model, at the points of its runs. Each is kept as soon as it is there, by the inputs of
//! the call: an interrupted stage, a larger design and a round of refinement ask for the missing ones only.

mod verify;

use std::path::{Path, PathBuf};
use std::time::Instant;

use lacuna::data::FailedRun;
use lacuna::plugin::model::{EvalError, Gradient};
use lacuna::run::{Observer, Progress, Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::arrays::{self, Array};
use lacuna_run::{Artifact, Kept, RunDirectory, Stage};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::calls::Calls;
use super::read::Data;
use super::simulator::{Setting, Simulator};
use super::surrogate::{Fitting, Purpose};
use crate::study::Study;
use verify::Verification;

/// Derivatives of the response at the training runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Gradients {
    /// Parameters of each run, `runs x parameters`.
    pub points: Matrix,
    /// Derivatives of the first output by all parameters, then of the second, `runs x (outputs * parameters)`, in the units
    /// of response and parameters; NaN for a run without.
    pub slopes: Matrix,
    /// Runs of which the model gave no derivatives.
    pub failed: Vec<FailedRun>,
}

const ARRAYS: &str = "gradients.nc";
const FAILED: &str = "failed.json";

/// Part of the artifact that is not an array.
#[derive(Serialize, Deserialize)]
struct Failed {
    failed: Vec<FailedRun>,
}

impl Artifact for Gradients {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        let (runs, parameters) = (self.points.rows(), self.points.columns());
        let outputs = self.slopes.columns() / parameters.max(1);
        let dimensions = [("run", runs), ("output", outputs), ("parameter", parameters)];
        let slopes = Array {
            name: "gradients".to_owned(),
            dimensions: dimensions.map(|(name, size)| (name.to_owned(), size)).into(),
            values: self.slopes.as_slice().into(),
            unit: None,
        };
        let points = Array::matrix("points", "run", "parameter", &self.points);
        arrays::write(&folder.join(ARRAYS), &[], &[points, slopes])?;
        files::write_json(&folder.join(FAILED), &Failed { failed: self.failed.clone() })?;
        Ok([ARRAYS, FAILED].map(str::to_owned).to_vec())
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        let path = folder.join(ARRAYS);
        let Failed { failed } = files::read_json(&folder.join(FAILED))?;
        Ok(Self {
            points: arrays::read(&path, "points")?.into_matrix(),
            slopes: arrays::read(&path, "gradients")?.into_matrix(),
            failed,
        })
    }
}

impl Gradients {
    /// The derivatives by some of the parameters.
    pub fn by(&self, parameters: &[usize]) -> Matrix {
        let all = self.points.columns();
        let outputs = self.slopes.columns() / all.max(1);
        let own: Vec<usize> =
            (0..outputs).flat_map(|o| parameters.iter().map(move |j| o * all + j)).collect();
        self.slopes.select_columns(&own)
    }
}

/// Number of runs without derivatives that are listed individually.
const TOLD: usize = 10;
/// Number of runs whose derivatives are computed side by side between two notes of progress.
const TOGETHER: usize = 32;

/// The derivatives at the training runs; `None` unless the study asks for them.
pub fn stage(
    study: &Study,
    data: &Data,
    fitting: &Fitting<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<Gradients>>, Stop> {
    let asked = study.surrogate.as_ref().is_some_and(|section| section.common.gradients);
    let (true, Purpose::Study, Some(section)) = (asked, fitting.purpose, &study.model) else {
        return Ok(None);
    };
    let Some(simulator) = Simulator::of(study)? else { return Ok(None) };
    let ensemble = data.runs()?;
    let names: Vec<String> = fitting.training.iter().map(|&i| ensemble.runs[i].clone()).collect();
    let points = ensemble.points.select_rows(&fitting.training);
    let sources = files::hash_sources(&simulator.model.files(&study.directory))?;
    let model = (section.built.identity(), &section.common);
    let made_from = json!([model, study.scenarios, study.layouts, study.unknowns, sources]);
    let folder = fitting.folder.beside(Stage::Simulate, "gradients");
    observer.begin(LABEL, "run", names.len() as u64);
    let calls = Calls::of_all(calls_file(run, &made_from)?);
    let kept = run.keep(&folder, &json!([made_from, names, points]), observer, |_| {
        let without =
            || Stop::new(format!("the model `{}` gives no derivatives", section.built.name));
        let gradient = simulator.model.gradient().ok_or_else(without)?;
        let asked = Asked { study, simulator: &simulator, gradient, calls: &calls };
        Verification::of(&asked, fitting.parameters, &names, &points).run(observer)?;
        asked.all(&names, points.clone(), observer)
    })?;
    tell(&kept.value, observer);
    Ok(Some(kept))
}

const LABEL: &str = "gradients";

fn tell(found: &Gradients, observer: &dyn Observer) {
    for failed in found.failed.iter().take(TOLD) {
        let (run, reason) = (&failed.run, &failed.reason);
        observer.warn(&format!("run {run} is used without its derivatives: {reason}"));
    }
    if found.failed.len() > TOLD {
        let more = found.failed.len() - TOLD;
        observer.warn(&format!("{more} further runs are used without their derivatives"));
    }
    let known = found.points.rows() - found.failed.len();
    observer.end(LABEL, &format!("derivatives of {known} runs"));
}

/// File of the derivatives of a model with these inputs, at whatever points.
fn calls_file(run: &RunDirectory, made_from: &serde_json::Value) -> Result<PathBuf, Stop> {
    let folder = Stage::Simulate.part("derivatives");
    let hash = run.hash_of(&folder, made_from)?;
    Ok(run.stage_folder(&folder).join(format!("{}.jsonl", &hash[..12])))
}

/// The model that is asked for derivatives.
struct Asked<'a> {
    study: &'a Study,
    simulator: &'a Simulator<'a>,
    gradient: &'a dyn Gradient,
    calls: &'a Calls,
}

impl Asked<'_> {
    /// The derivatives at all points; a run of which the model gives none has NaN.
    fn all(
        &self,
        names: &[String],
        points: Matrix,
        observer: &dyn Observer,
    ) -> Result<Gradients, Stop> {
        let progress = Progress::new(observer);
        let parameters = points.columns();
        let mut slopes = Matrix::zeros(0, self.study.layouts.len() * parameters);
        let mut failed = Vec::new();
        let rows: Vec<usize> = (0..points.rows()).collect();
        for some in rows.chunks(TOGETHER) {
            let found: Vec<Result<Vec<f64>, Unknown>> =
                some.par_iter().map(|&i| self.at(points.row(i))).collect();
            for (&i, found) in some.iter().zip(found) {
                match found {
                    Ok(row) => slopes.push_row(&row),
                    Err(Unknown::Here(reason)) => {
                        failed.push(FailedRun { run: names[i].clone(), reason });
                        slopes.push_row(&vec![f64::NAN; slopes.columns()]);
                    }
                    Err(Unknown::Everywhere(stop)) => return Err(stop),
                }
            }
            progress.add(some.len() as u64);
        }
        if failed.len() == names.len() {
            let reason = failed.first().map(|f| f.reason.clone()).unwrap_or_default();
            return Err(Stop::new(format!("the model gives no derivatives at any run: {reason}"))
                .help("take `gradients` out of `[surrogate]`"));
        }
        Ok(Gradients { points, slopes, failed })
    }

    /// The derivatives of all outputs at one point, one output after the other.
    fn at(&self, point: &[f64]) -> Result<Vec<f64>, Unknown> {
        let parameters = point.len();
        let mut row = vec![0.0; self.study.layouts.len() * parameters];
        for (place, setting) in self.simulator.settings.iter().enumerate() {
            let own = self.under(place, setting, point)?;
            let range = setting.outputs.start * parameters..setting.outputs.end * parameters;
            row[range].copy_from_slice(&own);
        }
        Ok(row)
    }

    /// The derivatives under the conditions of one scenario.
    fn under(
        &self,
        place: usize,
        setting: &Setting<'_>,
        point: &[f64],
    ) -> Result<Vec<f64>, Unknown> {
        if let Some(known) = self.calls.response(place, point) {
            return Ok(known);
        }
        let begun = Instant::now();
        let jacobian = self.simulator.jacobian(setting, self.gradient, point)?;
        if let Some(at) = jacobian.as_slice().iter().position(|slope| !slope.is_finite()) {
            let (output, parameter) = (at / point.len(), at % point.len());
            let name = &self.simulator.unknowns[parameter];
            let (slope, place) = (jacobian.as_slice()[at], setting.asked.describe(output));
            return Err(Unknown::Here(format!(
                "the derivative by `{name}` is {slope}{}",
                if place.is_empty() { String::new() } else { format!(" at {place}") }
            )));
        }
        let slopes = jacobian.into_vec();
        self.calls.note(place, point, &slopes, begun.elapsed()).map_err(Unknown::Everywhere)?;
        Ok(slopes)
    }
}

/// Reason why derivatives are not known.
enum Unknown {
    /// At this point.
    Here(String),
    /// At any point.
    Everywhere(Stop),
}

impl From<EvalError> for Unknown {
    fn from(error: EvalError) -> Self {
        match error {
            EvalError::Rejected(reason) => Self::Here(reason),
            EvalError::Fatal(reason) => Self::Everywhere(
                Stop::new(format!("the model gives no derivatives: {reason}"))
                    .help("repair the model, or take `gradients` out of `[surrogate]`"),
            ),
        }
    }
}
