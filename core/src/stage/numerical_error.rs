//! The model's own numerical error: some runs of the design again, with finer numerics.
//!
//! A mesh that is fine enough for a picture may be too coarse for a calibration over ten thousand points: its
//! error is common to all replicates and correlated between outputs, and looks like a change of the parameters.

use std::path::Path;

use serde_json::json;

use crate::linalg::Matrix;
use crate::math::moments;
use crate::plugin::discrepancy::CommonError;
use crate::plugin::reader::EnsembleSource;
use crate::run::arrays::{self, Array};
use crate::run::{Artifact, Kept, Observer, RunDirectory, Stop};
use crate::study::Study;

use super::design::Design;
use super::read::{self, Data};
use super::simulate;
use super::simulator::Simulator;

/// Differences between finer and ordinary runs.
#[derive(Debug, Clone, PartialEq)]
pub struct NumericalError {
    /// Finer minus ordinary response of each repeated run, `runs x outputs`.
    pub differences: Matrix,
}

const FILE: &str = "differences.nc";
const RUNS: &str = "2-simulate-finer";
const STAGE: &str = "3-numerical-error";

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
    /// The covariance of the numerical error: the mean square of the differences about zero, since all of them
    /// may lie on one side.
    pub fn common_error(&self) -> CommonError {
        let scale = (self.differences.rows() as f64).sqrt();
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

/// Repeats runs with finer numerics; `None` when the study does not ask for it.
pub fn stage(
    study: &Study,
    design: Option<&Kept<Design>>,
    data: &Kept<Data>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<NumericalError>>, Stop> {
    let (Some(section), Some(design)) = (&study.numerical_error, design) else { return Ok(None) };
    let simulator = Simulator::with_model(study, &section.model)?;
    let chosen = chosen(study, &design.value, section.runs);
    if chosen.is_empty() {
        let stop = Stop::new("no run of the design lies inside the prior, so none can be repeated");
        return Err(stop.help("take `[numerical_error]` out, or narrow the design"));
    }
    let all = simulate::names(design.value.points.rows());
    let names: Vec<String> = chosen.iter().map(|&i| all[i].clone()).collect();
    let points = design.value.points.select_rows(&chosen);
    let model = (section.model.built.name, &section.model.built.options, &section.model.common);
    observer.begin("finer", "run", names.len() as u64);
    let runs = simulate::kept(study, &simulator, RUNS, &names, &points, &model, run, observer)?;
    let folder = run.stage_folder(RUNS);
    let reader = study.simulations.as_ref().map(|s| (s.built.name, &s.built.options));
    let inputs = json!([runs.hash, data.hash, reader]);
    let kept = run.keep(STAGE, &inputs, observer, |_| {
        let source = EnsembleSource {
            directory: &study.directory,
            simulated: Some(&folder),
            parameters: &study.parameters,
            layout: &study.layout,
        };
        let finer = read::from_files(study, &source)?;
        let ordinary = &data.value.ensemble;
        let mut differences = Matrix::zeros(0, study.layout.len());
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
    let unit = &study.layout.unit;
    observer.end(
        "finer",
        &format!("{} runs, rms difference {:.3e} {unit}", names.len(), kept.value.rms()),
    );
    Ok(Some(kept))
}

/// The first runs of the design inside the prior.
fn chosen(study: &Study, design: &Design, count: usize) -> Vec<usize> {
    let inside = |point: &[f64]| {
        study.parameters.iter().zip(point).all(|(p, &x)| p.prior.log_density(x).is_finite())
    };
    (0..design.points.rows()).filter(|&i| inside(design.points.row(i))).take(count).collect()
}
