//! Stage 2: runs of the simulator at every point of the design.
//!
//! Every run's result file is written as the run finishes and recorded in `progress.jsonl`; a killed study continues
//! with the missing runs, and failed runs are repeated.

mod log;
mod table;

use std::fs;
use std::path::{Path, PathBuf};

use lacuna::plugin::Executor;
use lacuna::plugin::executor::{Batch, Finished, Job, Written};
use lacuna::run::{Observer, Progress, Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::{Folder, Kept, RunDirectory, Stage};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::design::Placed;
use super::imports::Imported;
use super::simulator::{Setting, Simulator};
use crate::study::Study;
use table::is_whole;

pub use log::{Log, Roll, earlier};
pub(super) use table::{TABLE, from_table, inside};

/// Runs of all scenarios.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulated {
    /// Runs of each scenario.
    pub scenarios: Vec<Made>,
    /// Names of the parameters.
    pub parameters: Vec<String>,
    /// Parameters of each run, `runs x parameters`.
    pub points: Matrix,
}

/// Runs of one scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Made {
    /// Folder of the scenario inside that of the stage; empty in a study without scenarios.
    pub folder: PathBuf,
    /// One record per run, in the order of the design.
    pub runs: Vec<RunRecord>,
}

/// Outcome of one run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// Name of the run.
    pub run: String,
    /// Result file; `None` unless the run is done.
    pub file: Option<String>,
    /// SHA-256 of the result file.
    pub sha256: Option<String>,
    /// True if the run stayed inside the model's range of validity.
    pub valid: bool,
    /// Reason of a failure.
    pub reason: Option<String>,
    /// Duration of the run, in seconds.
    pub seconds: f64,
}

/// Requested runs.
#[derive(Debug, Clone, Copy)]
pub struct Asked<'a> {
    /// Name of each run.
    pub names: &'a [String],
    /// Parameters of each run, `runs x parameters`.
    pub points: &'a Matrix,
    /// Finished runs among them that were made elsewhere, by folder.
    pub imported: &'a [Imported],
}

impl<'a> Asked<'a> {
    /// Requests runs at these points.
    pub fn new(names: &'a [String], points: &'a Matrix) -> Self {
        Self { names, points, imported: &[] }
    }
}

/// Runs the simulator; `None` if the study has no design or no model.
pub fn stage(
    study: &Study,
    placed: Option<&Placed>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<Simulated>>, Stop> {
    let (Some(placed), Some(simulator)) = (placed, Simulator::of(study)?) else { return Ok(None) };
    let Some(section) = &study.model else { return Ok(None) };
    let (names, points) = (&placed.names, &placed.design.value.points);
    let asked = Asked { names, points, imported: &placed.imported };
    let model = (section.built.identity(), &section.common);
    let count = points.rows() * simulator.settings.len();
    observer.begin(Stage::Simulate.label(), "run", count as u64);
    let inputs = Inputs::of(&simulator, &model)?;
    let smaller = smaller(study, placed);
    let smaller: Vec<Value> = smaller
        .iter()
        .map(|(names, points, some)| {
            inputs.value(Asked { names, points, imported: &placed.imported[..*some] })
        })
        .collect();
    run.go_on_from(&Stage::Simulate.folder(), &inputs.value(asked), &smaller)?;
    let kept = kept(study, &simulator, &Stage::Simulate.folder(), asked, &model, run, observer)?;
    observer.end(Stage::Simulate.label(), &summary(&kept.value));
    Ok(Some(kept))
}

/// Designs from which this one may have grown, the largest first, whose results are kept; each with the number of
/// folders that it imported.
fn smaller(study: &Study, placed: &Placed) -> Vec<(Vec<String>, Matrix, usize)> {
    let Some(section) = &study.design else { return Vec::new() };
    let keys = &section.common;
    let steps = |n: usize| (0..=n).rev();
    let mut all = Vec::new();
    for extensions in steps(keys.extended.len()) {
        let own: usize = keys.runs.get()
            + keys.extended[..extensions].iter().map(|count| count.get()).sum::<usize>();
        for folders in steps(placed.imported.len()) {
            let brought: usize = placed.imported[..folders].iter().map(|i| i.names.len()).sum();
            let rows: Vec<usize> = (0..own).chain(keys.total()..keys.total() + brought).collect();
            if rows.len() < placed.names.len() {
                let names = rows.iter().map(|&i| placed.names[i].clone()).collect();
                all.push((names, placed.design.value.points.select_rows(&rows), folders));
            }
        }
    }
    all
}

/// Everything the runs depend on besides their points.
struct Inputs {
    model: Value,
    asked: Value,
    files: String,
}

impl Inputs {
    fn of(simulator: &Simulator<'_>, model: &impl Serialize) -> Result<Self, Stop> {
        // In a study without scenarios the conditions are omitted, which keeps the hash.
        let asked: Vec<_> = simulator.settings.iter().map(|s| (&s.asked, s.scenario)).collect();
        let model_files: Vec<PathBuf> = simulator.model.files(simulator.study);
        let files = files::hash_sources(&model_files)?;
        let seeds: Vec<_> = simulator.settings.iter().filter_map(Setting::seeds_of).collect();
        // In a study without a stochastic model the seeds are omitted, which keeps the hash.
        let model = if seeds.is_empty() { json!(model) } else { json!([model, seeds]) };
        Ok(Self { model, asked: json!(asked), files })
    }

    fn value(&self, asked: Asked<'_>) -> Value {
        let Self { model, asked: shapes, files } = self;
        let plain = json!([asked.names, asked.points, model, shapes, files]);
        if asked.imported.is_empty() {
            return plain;
        }
        let hashes: Vec<&String> = asked.imported.iter().map(|imported| &imported.hash).collect();
        json!([plain, { "imports": hashes }])
    }
}

/// The runs at some points as a stage of their own: reused if present, made otherwise; failed runs and runs whose files
/// are lost are repeated.
pub fn kept(
    study: &Study,
    simulator: &Simulator<'_>,
    stage: &Folder,
    asked: Asked<'_>,
    model: &impl Serialize,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Simulated>, Stop> {
    let inputs = Inputs::of(simulator, model)?.value(asked);
    let folder = run.stage_folder(stage);
    let strict = *stage == Stage::Simulate.folder() && none_may_fail(study, asked.names.len());
    let make = |folder: &Path| simulate(study, simulator, asked, strict, folder, observer);
    let kept = run.keep(stage, &inputs, observer, make)?;
    if run.is_visited() {
        return Ok(kept);
    }
    let damaged = if kept.fresh { 0 } else { kept.value.damaged(&folder) };
    if damaged > 0 {
        observer.remark(&format!(
            "result files in {} are missing or have changed ({damaged} of {}); the runs are repeated",
            folder.display(),
            asked.names.len()
        ));
    }
    if damaged > 0 || (!kept.fresh && kept.value.failures() > 0) {
        run.reopen(stage)?;
        return run.keep(stage, &inputs, observer, make);
    }
    Ok(kept)
}

/// Like [`kept`], for runs the first of which may already be in the run directory; those are not repeated.
pub fn grown(
    study: &Study,
    simulator: &Simulator<'_>,
    stage: &Folder,
    asked: Asked<'_>,
    model: &impl Serialize,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Simulated>, Stop> {
    let inputs = Inputs::of(simulator, model)?;
    let first = |count: usize| {
        let points = asked.points.select_rows(&(0..count).collect::<Vec<_>>());
        inputs.value(Asked { names: &asked.names[..count], points: &points, imported: &[] })
    };
    let smaller: Vec<Value> = (1..asked.names.len()).rev().map(first).collect();
    run.go_on_from(stage, &inputs.value(asked), &smaller)?;
    kept(study, simulator, stage, asked, model, run, observer)
}

/// Returns true if the data cannot be read after any run has failed.
fn none_may_fail(study: &Study, runs: usize) -> bool {
    match &study.simulations {
        Some(section) => section.built.plugin.allowed_failures(runs) == Some(0),
        None => study.design.as_ref().is_none_or(|d| d.common.allow_failed.of(runs) == 0),
    }
}

fn summary(simulated: &Simulated) -> String {
    let invalid = simulated.all().filter(|r| r.file.is_some() && !r.valid).count();
    let mut text = format!("{} runs", simulated.all().count());
    if simulated.failures() > 0 {
        text.push_str(&format!(", {} failed", simulated.failures()));
    }
    if invalid > 0 {
        text.push_str(&format!(", {invalid} outside the model's range of validity"));
    }
    text
}

fn simulate(
    study: &Study,
    simulator: &Simulator<'_>,
    asked: Asked<'_>,
    strict: bool,
    folder: &Path,
    observer: &dyn Observer,
) -> Result<Simulated, Stop> {
    let progress = Progress::new(observer);
    let executor = study.executor.as_ref().ok_or_else(|| Stop::new("the study has no executor"))?;
    Roll::of(asked, simulator).write(folder)?;
    let work = |(place, setting): (usize, &Setting<'_>)| {
        let folder = inside(folder, &setting.folder);
        fs::create_dir_all(&folder).map_err(|error| files::cannot_write(&folder, &error))?;
        let executor = &*executor.built.plugin;
        let work =
            Work { study, executor, simulator, setting, place, asked, strict, folder: &folder };
        Ok(Made { folder: setting.folder.clone(), runs: work.run(&progress)? })
    };
    let settings = simulator.settings.iter().enumerate();
    let scenarios: Result<Vec<Made>, Stop> = if executor.built.plugin.waits() {
        // Jobs of one scenario need not wait for those of another.
        std::thread::scope(|scope| {
            let threads: Vec<_> =
                settings.map(|setting| scope.spawn(move || work(setting))).collect();
            let ended = threads.into_iter().map(|thread| {
                thread.join().unwrap_or_else(|_| Err(Stop::new("the executor panicked")))
            });
            ended.collect()
        })
    } else {
        settings.map(work).collect()
    };
    let parameters = simulator.unknowns.clone();
    Ok(Simulated { scenarios: scenarios?, parameters, points: asked.points.clone() })
}

/// Runs of one scenario.
struct Work<'a> {
    study: &'a Study,
    executor: &'a dyn Executor,
    simulator: &'a Simulator<'a>,
    setting: &'a Setting<'a>,
    /// Index of the scenario.
    place: usize,
    asked: Asked<'a>,
    /// True if no run may fail: the first one then decides whether the others are made.
    strict: bool,
    folder: &'a Path,
}

impl Work<'_> {
    /// Makes the missing runs.
    fn run(&self, progress: &Progress<'_>) -> Result<Vec<RunRecord>, Stop> {
        let (names, folder) = (self.asked.names, self.folder);
        let mut ended = earlier(folder);
        ended.retain(|_, record| is_whole(record, folder));
        let mut log = Log::open(folder)?;
        for imported in self.asked.imported {
            for name in imported
                .names
                .iter()
                .filter(|name| !ended.contains_key(*name))
                .cloned()
                .collect::<Vec<_>>()
            {
                if let Some(record) = imported.bring(self.place, &name, folder)? {
                    log.note(&record)?;
                    ended.insert(name, record);
                }
            }
        }
        let missing: Vec<usize> =
            (0..names.len()).filter(|&i| !ended.contains_key(&names[i])).collect();
        let fresh = missing.len() == names.len();
        progress.add((names.len() - missing.len()) as u64);
        let inputs = |i: usize| self.setting.inputs(self.asked.points.row(i));
        let jobs: Vec<Job> =
            missing.iter().map(|&i| Job { name: names[i].clone(), inputs: inputs(i) }).collect();
        let warn = |text: &str| progress.remark(text);
        let batch = Batch {
            model: self.simulator.model,
            recipe: &self.simulator.recipe,
            names: &self.simulator.names,
            units: &self.simulator.units,
            jobs: &jobs,
            layout: &self.setting.asked,
            scenario: self.setting.scenario,
            study: &self.study.directory,
            directory: folder,
            warn: &warn,
        };
        let mut hopeless = None;
        let mut note = |finished: Finished| {
            // Which run ends first depends on chance; which is first in the design does not.
            let first = finished.index == 0;
            let record = record(&jobs[finished.index].name, finished, folder)?;
            log.note(&record)?;
            let failed = record.reason.clone().filter(|_| first && fresh);
            if let (true, Some(reason)) = (self.strict, failed) {
                let stop = first_failed(&record.run, &reason);
                ended.insert(record.run.clone(), record);
                hopeless = Some(stop.clone());
                return Err(stop);
            }
            ended.insert(record.run.clone(), record);
            progress.add(1);
            Ok(())
        };
        let submitted = self.executor.submit(&batch, &mut note);
        if hopeless.is_some() {
            // The results of jobs still waiting elsewhere would not be used.
            self.executor.cancel(folder)?;
        }
        submitted.map_err(|stop| {
            let made = |name: &String| ended.get(name).is_some_and(|r| r.file.is_some());
            let done = names.iter().filter(|name| made(name)).count();
            stop.saved(format!("{done} of {} runs in {}", names.len(), folder.display()))
        })?;
        let runs: Option<Vec<RunRecord>> = names.iter().map(|name| ended.remove(name)).collect();
        runs.ok_or_else(|| Stop::new("the executor did not return all runs"))
    }
}

fn first_failed(run: &str, reason: &str) -> Stop {
    Stop::new(format!(
        "the first run, `{run}`, failed, and no run may fail, so the others are not made: {reason}"
    ))
    .help("fix the cause and run the same command again; `allow_failed` in `[design]` (in a study with `[simulations]` there) \
           sets how many runs may fail")
}

/// Names `run001`, `run002`, …, with as many digits as the last one needs.
pub fn names(count: usize) -> Vec<String> {
    let digits = count.to_string().len().max(3);
    (1..=count).map(|i| format!("run{i:0digits$}")).collect()
}

/// The record of a run that has ended.
pub fn record(run: &str, finished: Finished, folder: &Path) -> Result<RunRecord, Stop> {
    let run = run.to_owned();
    let seconds = finished.seconds;
    Ok(match finished.outcome {
        Ok(Written { file, valid }) => {
            let sha256 = Some(files::hash_file(&folder.join(&file))?);
            RunRecord { run, file: Some(file), sha256, valid, reason: None, seconds }
        }
        Err(reason) => {
            // The table has one line per run.
            let reason = Some(reason.replace(['\n', '\r'], "; "));
            RunRecord { run, file: None, sha256: None, valid: false, reason, seconds }
        }
    })
}
