//! Candidates that further tables of simulation runs show: each table was made with a suspected piece of physics in the
//! simulator.
//!
//! The study's surrogate learns the difference between the table and the study's emulator over the parameters, and over
//! the size of the physics if the table varies it. With the size of absence it changes nothing.

use std::sync::Arc;

use lacuna::data::Parameter;
use lacuna::plugin::effect::Description;
use lacuna::plugin::registry::Section;
use lacuna::plugin::{Effect, Emulator, Reader};
use lacuna::run::{Observer, Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::{Kept, RunDirectory, Stage};
use serde_json::json;
use toml::Table;

use crate::gap::candidates::Candidate;
use crate::gap::experiment::wider::FreeInput;
use crate::gap::inside::change::{Change, ChangeEffect};
use crate::gap::result::IN_RUNS;
use crate::gap::system::switched::InputEffect;
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::read::{self, Data};
use crate::stage::surrogate::{self, Fitting, Purpose};
use crate::study::Study;
use crate::study::gap::{AddedCandidate, RunsKeys};

/// The change that the physics of a table makes, learned by the study's surrogate.
struct RunsChange {
    /// The change of the response over the study's parameters, and over the size if the table varies it.
    learned: Box<dyn Emulator>,
    varies: bool,
    /// The size without the physics.
    absent: f64,
}

/// The candidates of the tables of a study whose physics is not part of it.
pub fn candidates(
    study: &Study,
    problem: &InverseProblem<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Vec<Candidate>, Stop> {
    let others = study.gap.runs.iter().filter(|section| !study.gap.is_added(&section.common));
    let one = |section: &Section<dyn Reader, RunsKeys>| {
        let kind = section.common.name.as_str().to_owned();
        let (effect, _) = learned(study, section, problem, run, observer)?;
        let plugin = IN_RUNS.to_owned();
        Ok(Candidate {
            kind,
            plugin,
            options: Table::new(),
            odds: 1.0,
            effect,
            contains: Vec::new(),
            tried: 1,
            beside: Vec::new(),
        })
    };
    others.map(one).collect()
}

/// Learns the effects of the tables whose physics is part of the study, which every stage after the emulator uses.
pub fn build_added(
    study: &Study,
    problem: &InverseProblem<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(), Stop> {
    let added = study
        .gap
        .keys
        .add
        .iter()
        .filter_map(|name| study.gap.runs.iter().find(|section| section.common.name == *name));
    let one = |section: &Section<dyn Reader, RunsKeys>| {
        let (effect, origin) = learned(study, section, problem, run, observer)?;
        Ok(AddedCandidate { name: section.common.name.as_str().to_owned(), effect, origin })
    };
    study.gap.set_added(added.map(one).collect::<Result<_, Stop>>()?);
    Ok(())
}

/// The physics of a table as an effect, with the hash of everything from which it was learned.
fn learned(
    study: &Study,
    section: &Section<dyn Reader, RunsKeys>,
    problem: &InverseProblem<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Arc<dyn Effect>, String), Stop> {
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
    let (fitted, learned) = surrogate::stage(study, &data, &fitting, run, observer)?;
    let square = |m: &Matrix| m.as_slice().iter().map(|y| y * y).sum::<f64>();
    let left = square(&learned.fit_error().residuals);
    let relative_error =
        (left / square(&data.value.runs()?.responses).max(f64::MIN_POSITIVE)).sqrt();
    let size = FreeInput::new(keys.size_name(), keys.unit.clone(), keys.absent, keys.prior.clone());
    let description = Description {
        title: keys.title.clone().unwrap_or_else(|| name.to_owned()),
        formula: "y + change of the response between two tables of runs".to_owned(),
        source: "the simulator's own".to_owned(),
    };
    let effect: Arc<dyn Effect> = Arc::new(ChangeEffect {
        change: RunsChange { learned, varies: keys.size.is_some(), absent: keys.absent },
        own: study.parameters.len(),
        layouts: study.layouts.clone(),
        inner: InputEffect { places: Vec::new(), inputs: vec![size], description },
        relative_error,
    });
    let laws = json!([fitted.hash, keys]);
    Ok((effect, files::hash(laws.to_string().as_bytes())))
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

impl Change for RunsChange {
    fn at(&self, point: &[f64], values: &[f64]) -> Vec<f64> {
        let at = |size: Option<f64>| {
            let point: Vec<f64> = point.iter().copied().chain(size).collect();
            self.learned.mean(&Matrix::from_vec(1, point.len(), point)).into_vec()
        };
        if self.varies {
            let absent = at(Some(self.absent));
            at(Some(values[0])).iter().zip(absent).map(|(a, b)| a - b).collect()
        } else {
            at(None).iter().map(|y| (values[0] - self.absent) * y).collect()
        }
    }
}
