//! The stage of `lacuna power`: many cases simulated from the data of a study, stored one by one.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use lacuna::math::random::Stream;
use lacuna::run::{Observer, Progress, Silent, Stop, files};
use lacuna_run::work::Then;
use lacuna_run::{Artifact, Kept, RunDirectory, Stage};
use serde_json::{Value, json};

use crate::gap::candidates::{place, sensors};
use crate::gap::experiment::{Experiment, MeasuredCurve};
use crate::gap::inside::InsideCandidates;
use crate::gap::inside::Pieces;
use crate::gap::power::{
    CaseOutcome, Injection, PowerDesign, PowerSetting, Rates, Screen, plan, rates, run,
};
use crate::gap::stage as gap;
use crate::gap::stage::prepared::{PreparedSearch, prepared};
use crate::gap::stage::search_model::SearchModel;
use crate::stage::cases::{Cases, Outcome, Visit};
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::stream;
use crate::study::Study;

const CASES: &str = "cases.jsonl";
const FILE: &str = "power.json";

impl Artifact for Rates {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_json(&folder.join(FILE), self)?;
        Ok(vec![FILE.to_owned()])
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        files::read_json(&folder.join(FILE))
    }
}

/// The search on many cases simulated from the data of a study. Finished cases are stored one by one, so that an
/// interrupted run can be resumed.
pub fn stage(
    study: &Study,
    design: &PowerDesign,
    simulations: Option<usize>,
    problem: &InverseProblem<'_>,
    directory: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Rates>, Stop> {
    let asked = json!([design, simulations]);
    let inputs = inputs(study, problem, &asked);
    let hash = directory.hash_of(&Stage::Power.folder(), &inputs)?;
    let pieces = Pieces::of(study)?;
    let inside = InsideCandidates::of(pieces.as_ref(), study, problem, directory, observer)?;
    directory.keep(&Stage::Power.folder(), &inputs, observer, |folder| {
        let all = Cases { study, stage: Stage::Power, folder, inputs: &hash, asked };
        let beginning = SearchModel::own(study, problem, &inside);
        prepared(study, problem, &beginning, &stream(study, "gap"), |prepared| {
            with_setting(study, prepared, simulations, |setting, stream| {
                outcomes(setting, &plan(design, prepared.candidates), stream, &all, observer)
            })
        })
        .map(|outcomes| Rates { search: search(study, problem), ..rates(&outcomes) })
    })
}

/// Everything on which the cases depend, except for their numbers.
fn inputs(study: &Study, problem: &InverseProblem<'_>, asked: &Value) -> Value {
    json!([gap::inputs(study, problem), asked[0], asked[1]])
}

impl Outcome for Option<CaseOutcome> {}

/// The cases in a process that is asked for some of them, as a model.
pub fn elsewhere(
    visit: &Visit,
    problem: &InverseProblem<'_>,
    directory: &mut RunDirectory,
    then: Then<'_>,
) -> Result<(), Stop> {
    let study = &visit.study;
    let asked: Value = visit.asked()?;
    let (design, simulations): (PowerDesign, Option<usize>) = visit.asked()?;
    let pieces = Pieces::of(study)?;
    let inside = InsideCandidates::of(pieces.as_ref(), study, problem, directory, &Silent)?;
    let beginning = SearchModel::own(study, problem, &inside);
    prepared(study, problem, &beginning, &stream(study, "gap"), |prepared| {
        let faults: Vec<_> = prepared.candidates.iter().flat_map(|c| c.effect.faults()).collect();
        let plan = plan(&design, prepared.candidates);
        with_setting(study, prepared, simulations, |setting, stream| {
            let make = |case: usize| {
                let wanted = plan.get(case).ok_or_else(|| Stop::new(format!("no case {case}")))?;
                let outcome = run(setting, case, wanted, &stream.at(case as u64));
                faults
                    .iter()
                    .find_map(|fault| fault.said())
                    .map_or(Ok(outcome), |said| Err(Stop::new(said)))
            };
            visit.serve(directory, &inputs(study, problem, &asked), &make, then)
        })
    })
}

/// The rates of an earlier run for the same search, if there is one in the run directory.
pub fn kept(
    study: &Study,
    problem: &InverseProblem<'_>,
    directory: &RunDirectory,
) -> Option<Rates> {
    let rates = Rates::load(&directory.stage_folder(&Stage::Power.folder())).ok()?;
    (rates.search == search(study, problem)).then_some(rates)
}

/// The hash of the inputs of the search of a study.
fn search(study: &Study, problem: &InverseProblem<'_>) -> String {
    files::hash(gap::inputs(study, problem).to_string().as_bytes())
}

/// The place of the sensor of each curve, from 0 to 1: by the positions of the sensors if the study states them for all,
/// otherwise by their order.
fn places(study: &Study, experiment: &Experiment<'_>) -> Vec<f64> {
    let stated = |curve: &MeasuredCurve| {
        let mut labels = curve.labels.iter();
        labels.find_map(|(axis, label)| {
            let along = study.positions.iter().find(|positions| positions.axis == *axis)?;
            along.at.get(label).copied()
        })
    };
    let known: Option<Vec<f64>> = experiment.curves.iter().map(stated).collect();
    let all = known.unwrap_or_else(|| {
        let sensors = sensors(experiment);
        let order = |curve| sensors.iter().position(|on| *on == place(curve)).unwrap_or(0) as f64;
        experiment.curves.iter().map(order).collect()
    });
    let low = all.iter().copied().fold(f64::INFINITY, f64::min);
    let high = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let length = if high > low { high - low } else { 1.0 };
    all.iter().map(|x| (x - low) / length).collect()
}

/// Passes on what all cases share, and their random stream: the search on the data themselves gives fit and noise.
fn with_setting<T>(
    study: &Study,
    prepared: &PreparedSearch<'_>,
    simulations: Option<usize>,
    use_it: impl FnOnce(&PowerSetting<'_>, &Stream) -> Result<T, Stop>,
) -> Result<T, Stop> {
    let found = prepared.search(&|_| {})?;
    // What the data themselves hide is part of no case.
    let first = found.path.first().map_or(&found.last, |step| &step.before);
    let mut options = prepared.options;
    options.simulations = simulations.unwrap_or(options.simulations);
    let (experiment, candidates) = (prepared.experiment, prepared.candidates);
    let (fit, noise) = (&first.fit, &found.noise);
    let setting = PowerSetting {
        experiment,
        candidates,
        options,
        fit,
        noise,
        places: &places(study, experiment),
        screen: &Screen::of(experiment, candidates, fit, noise),
    };
    use_it(&setting, &prepared.random.named("power"))
}

/// The outcomes of all cases, those of an interrupted run taken from its file.
fn outcomes(
    setting: &PowerSetting<'_>,
    plan: &[Injection],
    stream: &Stream,
    all: &Cases<'_>,
    observer: &dyn Observer,
) -> Result<Vec<CaseOutcome>, Stop> {
    let path = all.folder.join(CASES);
    let done = read(&path)?;
    let file = Mutex::new(append(&path)?);
    observer.begin(Stage::Power.label(), "case", plan.len() as u64);
    let progress = Progress::new(observer);
    let missing: Vec<usize> = (0..plan.len()).filter(|case| !done.contains_key(case)).collect();
    progress.add(done.len() as u64);
    let done = Mutex::new(done);
    let make = |case: usize| Ok(run(setting, case, &plan[case], &stream.at(case as u64)));
    let note = |case: usize, outcome: Option<CaseOutcome>| {
        write(&file, &path, case, outcome.as_ref())?;
        done.lock().unwrap_or_else(PoisonError::into_inner).insert(case, outcome);
        progress.add(1);
        Ok(())
    };
    all.compute(&missing, &make, &note, observer)?;
    let done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    observer.end(Stage::Power.label(), &format!("{} cases", done.len()));
    Ok(done.into_values().flatten().collect())
}

/// The finished cases; an incomplete last line is ignored.
fn read(path: &Path) -> Result<BTreeMap<usize, Option<CaseOutcome>>, Stop> {
    if !path.exists() {
        return Ok(BTreeMap::new());
    }
    let text = String::from_utf8_lossy(&files::read(path)?).into_owned();
    Ok(text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect())
}

/// The file to which cases are appended; an incomplete last line is ended first.
fn append(path: &Path) -> Result<File, Stop> {
    let is_cut = path.exists() && !files::read(path)?.ends_with(b"\n");
    let mut file = OpenOptions::new()
        .create(true)
        .append(true)
        .open(path)
        .map_err(|error| files::cannot_write(path, &error))?;
    if is_cut {
        file.write_all(b"\n").map_err(|error| files::cannot_write(path, &error))?;
    }
    Ok(file)
}

fn write(
    file: &Mutex<File>,
    path: &Path,
    case: usize,
    outcome: Option<&CaseOutcome>,
) -> Result<(), Stop> {
    let line = json!([case, outcome]).to_string() + "\n";
    let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
    file.write_all(line.as_bytes()).map_err(|error| files::cannot_write(path, &error))
}
