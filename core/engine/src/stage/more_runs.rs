//! Runs that are added to those of the design, and regions of the parameters.

use lacuna::data::{Ensemble, Parameter};
use lacuna::math::distribution::Distribution;
use lacuna::run::{Observer, Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::{Folder, Kept, RunDirectory};
use serde_json::json;

use super::read::{self, Data, Runs};
use super::simulate;
use super::simulator::Simulator;
use crate::study::Study;

/// One interval per parameter.
pub type Intervals = Vec<(f64, f64)>;

/// Bounds within which every region stays: those of design and prior.
pub fn bounds(parameter: &Parameter) -> (f64, f64) {
    let (design, prior) = (parameter.design.support(), parameter.prior.support());
    (design.0.max(prior.0), design.1.min(prior.1))
}

/// Returns true if a point lies in the region.
pub fn is_inside(place: &[(f64, f64)], point: &[f64]) -> bool {
    place.iter().zip(point).all(|(&(low, high), &x)| low <= x && x <= high)
}

/// Parameters with uniform designs in the region.
pub fn within(parameters: &[Parameter], place: &[(f64, f64)]) -> Vec<Parameter> {
    let narrowed = |(p, &(low, high)): (&Parameter, &(f64, f64))| Parameter {
        design: Distribution::Uniform([low, high]),
        ..p.clone()
    };
    parameters.iter().zip(place).map(narrowed).collect()
}

/// Further runs.
pub struct More<'a> {
    /// Folder in which they are kept.
    pub folder: Folder,
    /// Beginning of their names.
    pub prefix: &'a str,
    /// Parameters of each run, `runs x parameters`.
    pub points: &'a Matrix,
    /// True if runs may fail, whatever the study says about its other runs; they are left out.
    pub may_fail: bool,
}

impl More<'_> {
    /// Makes the runs and adds them to the data.
    pub fn added(
        &self,
        study: &Study,
        data: Kept<Data>,
        run: &mut RunDirectory,
        observer: &dyn Observer,
    ) -> Result<Kept<Data>, Stop> {
        let (Some(simulator), Some(section)) = (Simulator::of(study)?, &study.model) else {
            return Err(Stop::new("the study has no model to run again")
                .help("remove `refine` from `[surrogate]`, or add `[model]`"));
        };
        let name = |name: String| format!("{}-{name}", self.prefix);
        let names: Vec<String> =
            simulate::names(self.points.rows()).into_iter().map(name).collect();
        let model = (section.built.identity(), &section.common);
        let label = self.folder.stage().label();
        observer.begin(label, "run", names.len() as u64);
        let asked = simulate::Asked::new(&names, self.points);
        let made = simulate::kept(study, &simulator, &self.folder, asked, &model, run, observer)?;
        observer.end(label, &format!("{} further runs", names.len()));
        let folder = run.stage_folder(&self.folder);
        let runs = Runs { folder: &folder, made: &made.value };
        let more = if self.may_fail {
            read::ensemble_with_failed(study, runs)?
        } else {
            read::ensemble(study, Some(runs))?
        };
        let ensemble = data.value.ensemble.map(|first| joined(first, more));
        let value = Data { ensemble, ..data.value };
        let hash = files::hash(json!([data.hash, made.hash]).to_string().as_bytes());
        Ok(Kept { value, hash, ..data })
    }
}

/// Combines the runs of two ensembles.
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
