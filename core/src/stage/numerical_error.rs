//! The model's own numerical error: some runs of the design again, with finer numerics.
//!
//! A mesh that is fine enough for a picture may be too coarse for a calibration over ten thousand points: its
//! error is common to all replicates and correlated between outputs, and looks like a change of the parameters.

use std::path::Path;

use serde_json::json;

use crate::data::{Ensemble, Parameter};
use crate::linalg::Matrix;
use crate::math::moments;
use crate::plugin::discrepancy::CommonError;
use crate::run::arrays::{self, Array};
use crate::run::{Artifact, Kept, Observer, RunDirectory, Stop};
use crate::study::Study;

use super::read::{self, Data, Runs};
use super::simulate;
use super::simulator::Simulator;

/// Differences between finer and ordinary runs.
#[derive(Debug, Clone, PartialEq)]
pub struct NumericalError {
    /// Finer minus ordinary response of each repeated run, `runs x outputs`.
    pub differences: Matrix,
}

const FILE: &str = "differences.nc";
/// The folders of the finer runs and of the differences.
pub const FOLDERS: [&str; 2] = ["2-simulate-finer", "3-numerical-error"];

impl Artifact for NumericalError {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        let array = Array::matrix("differences", "run", "output", &self.differences);
        arrays::write(&folder.join(FILE), &[], &[array])?;
        Ok(vec![FILE.to_owned()])
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        let differences = arrays::read(&folder.join(FILE), "differences")?.into_matrix();
        Ok(Self { differences })
    }
}

impl NumericalError {
    /// The covariance of the numerical error: the mean square of `whole` times the differences about zero, since all
    /// of them may lie on one side.
    pub fn common_error(&self, whole: f64) -> CommonError {
        let scale = (self.differences.rows() as f64).sqrt() / whole;
        let d = &self.differences;
        let factor = Matrix::from_fn(d.columns(), d.rows(), |i, k| d[(k, i)] / scale);
        CommonError { origin: "numerics".to_owned(), factor, predictive: true }
    }

    /// The root mean square difference over runs and outputs.
    pub fn rms(&self) -> f64 {
        let squares: Vec<f64> = self.differences.as_slice().iter().map(|d| d * d).collect();
        moments::mean(&squares).sqrt()
    }
}

/// Repeats runs with finer numerics, those inside the prior and the region; `None` when the study does not ask for
/// it, or when there is no such run and refinement will make some.
pub fn stage(
    study: &Study,
    data: &Kept<Data>,
    region: Option<&[(f64, f64)]>,
    [runs_folder, folder]: [&str; 2],
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<NumericalError>>, Stop> {
    let Some(section) = &study.numerical_error else { return Ok(None) };
    let simulator = Simulator::with_model(study, &section.model)?;
    let ensemble = data.value.runs()?;
    let chosen = chosen(study, ensemble, region, section.runs);
    if chosen.is_empty() {
        if study.surrogate.as_ref().is_some_and(|s| s.common.refine.is_some()) {
            return Ok(None);
        }
        let stop = Stop::new("no run of the design lies inside the prior, so none can be repeated");
        return Err(stop.help("take `[numerical_error]` out, or narrow the design"));
    }
    let names: Vec<String> = chosen.iter().map(|&i| ensemble.runs[i].clone()).collect();
    let points = ensemble.points.select_rows(&chosen);
    let model = (section.model.built.identity(), &section.model.common);
    observer.begin("finer", "run", names.len() as u64);
    let runs = simulate::kept(
        study,
        &simulator,
        runs_folder,
        simulate::Asked::new(&names, &points),
        &model,
        run,
        observer,
    )?;
    let made = run.stage_folder(runs_folder);
    let reader = study.simulations.as_ref().map(|s| s.built.identity());
    let inputs = json!([runs.hash, data.hash, reader]);
    let kept = run.keep(folder, &inputs, observer, |_| {
        let runs = Runs { folder: &made, made: &runs.value };
        let finer = read::ensemble(study, Some(runs))?;
        let ordinary = ensemble;
        let mut differences = Matrix::zeros(0, study.layouts.len());
        for (name, response) in finer.runs.iter().zip(finer.responses.iter_rows()) {
            if let Some(row) = ordinary.runs.iter().position(|run| run == name) {
                let base = ordinary.responses.row(row);
                let difference: Vec<f64> = response.iter().zip(base).map(|(a, b)| a - b).collect();
                differences.push_row(&difference);
            }
        }
        if differences.rows() == 0 {
            return Err(Stop::new("none of the repeated runs has a usable response"));
        }
        Ok(NumericalError { differences })
    })?;
    let unit = study.layouts.unit();
    observer.end(
        "finer",
        &format!("{} runs, rms difference {:.3e} {unit}", names.len(), kept.value.rms()),
    );
    Ok(Some(kept))
}

/// The first runs inside the prior and the region.
fn chosen(
    study: &Study,
    ensemble: &Ensemble,
    region: Option<&[(f64, f64)]>,
    count: usize,
) -> Vec<usize> {
    let inside = |&i: &usize| {
        let point = ensemble.points.row(i);
        let possible = |(p, &x): (&Parameter, &f64)| p.prior.log_density(x).is_finite();
        study.parameters.iter().zip(point).all(possible)
            && region.is_none_or(|r| r.iter().zip(point).all(|(&(a, b), &x)| a <= x && x <= b))
    };
    (0..ensemble.runs.len()).filter(inside).take(count).collect()
}
