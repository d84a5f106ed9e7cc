//! Surrogate of two ensembles: the runs of the study, and cheaper, less accurate ones.

use lacuna::data::{Ensemble, Parameter};
use lacuna::plugin::surrogate::{FitError, Training};
use lacuna::plugin::{Emulator, Fact, Surrogate};
use lacuna::run::{Observer, Progress, Stop, Tasks, files};
use lacuna_linalg::Matrix;
use lacuna_run::{Kept, RunDirectory, Stage};
use serde_json::json;

use super::design::{self, Placed};
use super::fidelity::{Combined, Difference, Lesson, Rule, Source, joined, split};
use super::read::{self, Data, Runs};
use super::simulate::{self, Asked};
use super::simulator::Simulator;
use super::stream;
use crate::study::Study;
use crate::study::fidelity::{Cheap, LowFidelity};

/// Part of the folder names that marks the cheap runs and the data read from them.
const CHEAPER: &str = "cheaper";

/// The data with the cheap runs, if the study has any: made at the points of its own runs and at others, or read.
pub fn stage(
    study: &Study,
    placed: Option<&Placed>,
    data: Kept<Data>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Data>, Stop> {
    let Some(section) = &study.low_fidelity else { return Ok(data) };
    let cheap = match &section.source {
        Cheap::Model(..) => made(study, section, placed, run, observer)?,
        Cheap::Reader(reader) => {
            let files = read::files_of(study, std::iter::once(&*reader.built.plugin));
            let parameters: Vec<_> = study.parameters.iter().map(|p| (&p.name, &p.unit)).collect();
            let identity = reader.built.identity();
            let inputs = json!([identity, files::hash_sources(&files)?, study.layouts, parameters]);
            run.keep(&Stage::Read.part(CHEAPER), &inputs, observer, |_| {
                let reader = Some(&*reader.built.plugin);
                read::ensemble_through(study, &study.parameters, reader, None).map(cheap_data)
            })?
        }
    };
    observer.begin(Stage::Read.label(), "file", 0);
    observer.end(Stage::Read.label(), &format!("{} cheaper runs", cheap.value.runs()?.runs.len()));
    let hash = files::hash(json!([data.hash, cheap.hash]).to_string().as_bytes());
    let value = Data { cheaper: cheap.value.ensemble, ..data.value };
    Ok(Kept { value, hash, ..data })
}

fn cheap_data(ensemble: Ensemble) -> Data {
    Data { ensemble: Some(ensemble), measured: None, cheaper: None }
}

/// Runs the cheap model.
fn made(
    study: &Study,
    section: &LowFidelity,
    placed: Option<&Placed>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Data>, Stop> {
    let (Cheap::Model(model, further), Some(placed), Some(design)) =
        (&section.source, placed, &study.design)
    else {
        return Err(Stop::new("the study has no design of which cheap runs could be made"));
    };
    let own = &placed.design.value.points;
    let random = stream(study, "design").named("low fidelity");
    let cube = design.built.plugin.place(&study.parameters, *further, &random)?;
    let mut points = own.clone();
    design::physical(&cube, &study.parameters).iter_rows().for_each(|row| points.push_row(row));
    let mut names = placed.names.clone();
    names.extend(simulate::names(*further).into_iter().map(|name| format!("cheap-{name}")));
    let simulator = Simulator::with_model(study, model)?;
    let identity = (model.built.identity(), &model.common);
    let count = names.len() * simulator.settings.len();
    observer.begin("cheaper", "run", count as u64);
    let asked = Asked::new(&names, &points);
    let runs = Stage::Simulate.part(CHEAPER);
    let made = simulate::kept(study, &simulator, &runs, asked, &identity, run, observer)?;
    observer.end("cheaper", &format!("{count} runs"));
    let folder = run.stage_folder(&runs);
    let reader = study.simulations.as_ref().map(|s| s.built.identity());
    run.keep(
        &Stage::Read.part(CHEAPER),
        &json!([made.hash, reader, study.layouts]),
        observer,
        |_| {
            read::ensemble(study, Some(Runs { folder: &folder, made: &made.value })).map(cheap_data)
        },
    )
}

/// Surrogate of the difference, with its name.
fn of_difference<'a>(
    study: &'a Study,
    section: &'a LowFidelity,
) -> Option<(&'a dyn Surrogate, &'a str)> {
    let own = section.surrogate.as_ref().map(|s| &s.built);
    let built = own.or(study.surrogate.as_ref().map(|s| &s.built))?;
    Some((&*built.plugin, built.name))
}

/// Everything the surrogate depends on besides its runs, for the hash under which it is kept.
pub fn identity(study: &Study) -> Option<serde_json::Value> {
    let section = study.low_fidelity.as_ref()?;
    Some(json!(section.surrogate.as_ref().map(|s| s.built.identity())))
}

/// The emulator of the study's runs: of these alone, or of both ensembles.
///
/// `parameters` have the distributions of the cheap runs. Its leave-one-out errors are those of the study's runs that
/// were left out of both ensembles.
pub fn fit(
    study: &Study,
    runs: &Training<'_>,
    cheap: Option<(&Matrix, &Matrix)>,
    parameters: &[Parameter],
    progress: &Progress<'_>,
    tasks: Tasks<'_>,
) -> Result<Box<dyn Emulator>, Stop> {
    let no_surrogate = || Stop::new("the study has no surrogate");
    let section = study.surrogate.as_ref().ok_or_else(no_surrogate)?;
    let (own, random) = (&*section.built.plugin, stream(study, "surrogate"));
    let (Some(low), Some((points, responses))) = (&study.low_fidelity, cheap) else {
        return own.fit_with_tasks(runs, &random, progress, tasks);
    };
    let training =
        Training { parameters, layouts: runs.layouts, points, responses, gradients: None };
    let emulator = own.fit_with_tasks(&training, &random, progress, tasks)?;
    let (cheap, predicted) = at(&*emulator, points, responses, runs.points);
    let (plugin, _) = of_difference(study, low).ok_or_else(no_surrogate)?;
    let lesson = Lesson {
        plugin,
        parameters: runs.parameters,
        layouts: runs.layouts,
        points: runs.points,
        fine: runs.responses,
        cheap: &cheap,
        predicted: &predicted,
        rules: &Rule::OF_ENSEMBLES,
        stream: &random,
    };
    let difference = lesson.learn(progress)?;
    load(study, &joined(&emulator.save()?, &difference.to_bytes()?))
}

/// The cheap response at some points, and its prediction without a cheap run at that point; without a run both are the
/// emulator's.
fn at(
    emulator: &dyn Emulator,
    cheap: &Matrix,
    responses: &Matrix,
    points: &Matrix,
) -> (Matrix, Matrix) {
    let mut known = emulator.mean(points);
    let mut predicted = known.clone();
    let residuals = &emulator.fit_error().residuals;
    for (i, point) in points.iter_rows().enumerate() {
        if let Some(row) = cheap.iter_rows().position(|other| is_same(point, other)) {
            known.row_mut(i).copy_from_slice(responses.row(row));
            let left_out = responses.row(row).iter().zip(residuals.row(row));
            let left_out: Vec<f64> = left_out.map(|(y, residual)| y - residual).collect();
            predicted.row_mut(i).copy_from_slice(&left_out);
        }
    }
    (known, predicted)
}

/// Returns true if two points are equal up to the rounding of numbers written with nine digits.
pub fn is_same(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(x, y)| (x - y).abs() <= 1e-9 * x.abs().max(y.abs()))
}

/// Terms of the sum that forms the study's emulator, and the offset of each output.
pub fn sources<'a>(study: &'a Study, bytes: &[u8]) -> Result<(Vec<Source<'a>>, Vec<f64>), Stop> {
    let section =
        study.surrogate.as_ref().ok_or_else(|| Stop::new("the study has no surrogate"))?;
    let (plugin, name) = (&*section.built.plugin, section.built.name);
    let Some(low) = &study.low_fidelity else {
        let outputs = study.layouts.len();
        let source = Source { plugin, name, bytes: bytes.to_vec(), weights: vec![1.0; outputs] };
        return Ok((vec![source], vec![0.0; outputs]));
    };
    let (cheap, difference) = split(bytes)?;
    let difference = Difference::from_bytes(difference)?;
    let weights = difference.scale.clone();
    let mut all = vec![Source { plugin, name, bytes: cheap.to_vec(), weights }];
    if let (Some(bytes), Some((plugin, name))) = (difference.emulator, of_difference(study, low)) {
        let weights = difference.emulated.iter().map(|e| f64::from(u8::from(*e))).collect();
        all.push(Source { plugin, name, bytes, weights });
    }
    Ok((all, difference.offset))
}

/// Restores the study's emulator from its saved bytes.
pub fn load(study: &Study, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop> {
    let section =
        study.surrogate.as_ref().ok_or_else(|| Stop::new("the study has no surrogate"))?;
    if study.low_fidelity.is_none() {
        return section.built.plugin.load(bytes);
    }
    let (sources, offset) = sources(study, bytes)?;
    let (cheap, difference) = split(bytes)?;
    let difference = Difference::from_bytes(difference)?;
    let mut facts = difference.facts(&study.layouts.unit().to_string());
    let of_cheap = section.built.plugin.load(cheap)?.facts().into_iter();
    facts.extend(of_cheap.map(|f| Fact::new(format!("cheap runs: {}", f.name), f.value)));
    let Difference { relative, residuals, .. } = difference;
    let error = FitError { relative, residuals };
    Ok(Box::new(Combined::new(&sources, &offset, error, facts, bytes.to_vec())?))
}
