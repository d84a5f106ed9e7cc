//! Stage 1: where the simulator is run.

use std::path::Path;

use serde_json::json;

use crate::data::Parameter;
use crate::linalg::Matrix;
use crate::run::arrays::{self, Array};
use crate::run::{Artifact, Kept, Observer, RunDirectory, Stop};
use crate::study::Study;

use super::stream;

/// The runs that are to be made.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// The parameters of each run in physical units, `runs x parameters`.
    pub points: Matrix,
}

const FILE: &str = "points.nc";

impl Artifact for Design {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        let points = Array::matrix("points", "run", "parameter", &self.points);
        arrays::write(&folder.join(FILE), &[], &[points])?;
        Ok(vec![FILE.to_owned()])
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        Ok(Self { points: arrays::read(&folder.join(FILE), "points")?.into_matrix() })
    }
}

/// Places the runs; `None` when the study has no design.
pub fn stage(
    study: &Study,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<Design>>, Stop> {
    let Some(section) = &study.design else { return Ok(None) };
    let runs = section.common.runs.get();
    let laws: Vec<_> = study.parameters.iter().map(|p| (&p.name, &p.design)).collect();
    let inputs = json!([section.built.identity(), runs, laws, study.about.seed]);
    observer.begin("design", "run", 0);
    let kept = run.keep("1-design", &inputs, observer, |_| {
        let plugin = &section.built.plugin;
        let cube = plugin.place(&study.parameters, runs, &stream(study, "design"))?;
        Ok(Design { points: physical(&cube, &study.parameters) })
    })?;
    observer.end("design", &format!("{runs} runs by {}", section.built.name));
    Ok(Some(kept))
}

/// Points of the unit cube through the quantile function of each parameter's design distribution.
pub fn physical(cube: &Matrix, parameters: &[Parameter]) -> Matrix {
    Matrix::from_fn(cube.rows(), cube.columns(), |i, j| parameters[j].design.quantile(cube[(i, j)]))
}
