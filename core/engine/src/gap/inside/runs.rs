//! Candidates that further tables of simulation runs show: each table was made with a suspected piece of physics in the
//! simulator.
//!
//! The study's surrogate learns the difference between the table and the study's emulator over the parameters, and over
//! the size of the physics if the table varies it. With the size of absence it changes nothing.

use std::sync::Arc;

use lacuna::data::{Layout, Layouts, Parameter};
use lacuna::plugin::effect::{Description, Reach, SMOOTH, Situation, by_parameter_steps_of};
use lacuna::plugin::registry::Section;
use lacuna::plugin::{Component, Effect, Emulator, Hyperparameter, Reader};
use lacuna::run::{Observer, Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::{Kept, RunDirectory, Stage};
use serde_json::json;
use toml::Table;

use crate::gap::candidates::Candidate;
use crate::gap::experiment::wider::FreeInput;
use crate::gap::result::IN_RUNS;
use crate::gap::system::switched::InputEffect;
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::read::{self, Data};
use crate::stage::surrogate::{self, Fitting, Purpose};
use crate::study::Study;
use crate::study::gap::RunsKeys;

/// The physics of a table as an effect on the response of the study's emulator.
struct RunsEffect {
    /// The change of the response over the study's parameters, and over the size if the table varies it.
    change: Box<dyn Emulator>,
    /// The number of the study's parameters.
    own: usize,
    varies: bool,
    layouts: Layouts,
    inner: InputEffect,
    relative_error: f64,
}

/// The candidates of all tables of a study.
pub fn candidates(
    study: &Study,
    problem: &InverseProblem<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Vec<Candidate>, Stop> {
    let one =
        |section: &Section<dyn Reader, RunsKeys>| candidate(study, section, problem, run, observer);
    study.gap.runs.iter().map(one).collect()
}

fn candidate(
    study: &Study,
    section: &Section<dyn Reader, RunsKeys>,
    problem: &InverseProblem<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Candidate, Stop> {
    let keys = &section.common;
    let parameters = parameters(study, keys);
    let data = data(study, section, &parameters, problem, run, observer)?;
    let name = keys.name.as_str();
    let fitting = Fitting {
        folder: Stage::Surrogate.inside(Stage::Gap, name),
        parameters: &parameters,
        training: (0..data.value.runs()?.runs.len()).collect(),
        validation: Vec::new(),
        purpose: Purpose::Gap(name),
    };
    let (_, change) = surrogate::stage(study, &data, &fitting, run, observer)?;
    let square = |m: &Matrix| m.as_slice().iter().map(|y| y * y).sum::<f64>();
    let left = square(&change.fit_error().residuals);
    let relative_error =
        (left / square(&data.value.runs()?.responses).max(f64::MIN_POSITIVE)).sqrt();
    let size = FreeInput::new(keys.size_name(), keys.unit.clone(), keys.absent, keys.prior.clone());
    let description = Description {
        title: keys.title.clone().unwrap_or_else(|| name.to_owned()),
        formula: "y + change of the response between two tables of runs".to_owned(),
        source: "the simulator's own".to_owned(),
    };
    let effect: Arc<dyn Effect> = Arc::new(RunsEffect {
        change,
        own: study.parameters.len(),
        varies: keys.size.is_some(),
        layouts: study.layouts.clone(),
        inner: InputEffect { places: Vec::new(), inputs: vec![size], description },
        relative_error,
    });
    let (kind, plugin) = (name.to_owned(), IN_RUNS.to_owned());
    Ok(Candidate { kind, plugin, options: Table::new(), odds: 1.0, effect })
}

/// The study's parameters, and the size if the table varies it.
fn parameters(study: &Study, keys: &RunsKeys) -> Vec<Parameter> {
    let size = keys.size.as_ref().map(|size| Parameter {
        unit: keys.unit.clone(),
        ..Parameter::plain(size.as_str(), keys.prior.clone())
    });
    study.parameters.iter().cloned().chain(size).collect()
}

/// The table, with the response of the study's emulator subtracted.
fn data(
    study: &Study,
    section: &Section<dyn Reader, RunsKeys>,
    parameters: &[Parameter],
    problem: &InverseProblem<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Data>, Stop> {
    let reader = &*section.built.plugin;
    let sources = read::files_of(study, std::iter::once(reader));
    let laws: Vec<_> = parameters.iter().map(|p| (&p.name, &p.unit)).collect();
    let identity = section.built.identity();
    let inputs =
        json!([identity, files::hash_sources(&sources)?, study.layouts, laws, problem.origin()]);
    let folder = Stage::Read.inside(Stage::Gap, section.common.name.as_str());
    run.keep(&folder, &inputs, observer, |_| {
        let mut ensemble = read::ensemble_through(study, parameters, Some(reader), None)?;
        let own: Vec<usize> = (0..study.parameters.len()).collect();
        let mean = problem.forward().mean(&ensemble.points.select_columns(&own));
        let pairs = ensemble.responses.as_mut_slice().iter_mut().zip(mean.as_slice());
        pairs.for_each(|(y, base)| *y -= base);
        Ok(Data { ensemble: Some(ensemble), measured: None, cheaper: None })
    })
}

impl RunsEffect {
    /// The change of the response of a block.
    fn change(&self, layout: &Layout, values: &[f64], point: &[f64]) -> Vec<f64> {
        let at = |size: Option<f64>| {
            let point: Vec<f64> = point[..self.own].iter().copied().chain(size).collect();
            self.change.mean(&Matrix::from_vec(1, point.len(), point)).into_vec()
        };
        let absent = self.inner.inputs[0].absent;
        let all: Vec<f64> = if self.varies {
            at(Some(values[0])).iter().zip(at(Some(absent))).map(|(a, b)| a - b).collect()
        } else {
            at(None).iter().map(|y| (values[0] - absent) * y).collect()
        };
        let mut parts = self.layouts.parts();
        let range = parts.find(|(block, _)| *block == layout).map(|(_, range)| range);
        range.map_or_else(Vec::new, |range| all[range].to_vec())
    }
}

impl Component for RunsEffect {}

impl Effect for RunsEffect {
    fn describe(&self) -> Description {
        self.inner.describe()
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        self.inner.parameters(layout)
    }

    fn absent(&self, layout: &Layout) -> Vec<f64> {
        self.inner.absent(layout)
    }

    /// The response is returned unchanged: the change depends on a point of the parameters.
    fn apply(&self, _layout: &Layout, response: &[f64], _values: &[f64]) -> Vec<f64> {
        response.to_vec()
    }

    fn apply_at(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
        point: &[f64],
    ) -> Vec<f64> {
        let change = self.change(layout, values, point);
        response.iter().zip(change).map(|(y, d)| y + d).collect()
    }

    fn by_parameters_at(
        &self,
        layout: &Layout,
        _response: &[f64],
        values: &[f64],
        point: &[f64],
    ) -> Matrix {
        let change = |values: &[f64]| self.change(layout, values, point);
        by_parameter_steps_of(&self.parameters(layout), layout.len(), values, SMOOTH, change)
    }

    /// The change is added, and its own slopes by the parameters are of second order: they are left out.
    fn push_forward(
        &self,
        _layout: &Layout,
        _response: &[f64],
        _values: &[f64],
        tangent: &[f64],
    ) -> Vec<f64> {
        tangent.to_vec()
    }

    fn starts(&self, layout: &Layout, situation: &Situation<'_>) -> Vec<Vec<f64>> {
        self.inner.starts(layout, situation)
    }

    fn proposals(&self, _situation: &Situation<'_>) -> Vec<Table> {
        Vec::new()
    }

    fn reach(&self) -> Reach {
        Reach::Whole
    }

    fn acts_first(&self) -> bool {
        true
    }

    fn relative_error(&self) -> f64 {
        self.relative_error
    }
}
