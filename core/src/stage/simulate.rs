//! Stage 2: the simulator is run at every point of the design.
//!
//! Every run's result file is written as it finishes and noted in `progress.jsonl`; a killed study goes
//! on with the runs that are missing, and runs that failed are tried again.

use std::collections::BTreeMap;
use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::linalg::Matrix;
use crate::plugin::executor::{Batch, Finished, Job, Written};
use crate::run::{Artifact, Kept, Observer, Progress, RunDirectory, Stop, files};
use crate::study::Study;

use super::design::Design;
use super::simulator::{Setting, Simulator};

/// The runs that were made.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulated {
    /// The runs of each scenario.
    pub scenarios: Vec<Made>,
    /// The names of the parameters.
    pub parameters: Vec<String>,
    /// The parameters of each run, `runs x parameters`.
    pub points: Matrix,
}

/// The runs of one scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Made {
    /// Their folder in that of the stage; empty in a study without scenarios.
    pub folder: PathBuf,
    /// One record a run, in the order of the design.
    pub runs: Vec<RunRecord>,
}

/// How one run ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// The run's name.
    pub run: String,
    /// The result file, when the run is done.
    pub file: Option<String>,
    /// The SHA-256 of that file.
    pub sha256: Option<String>,
    /// Whether the run stayed inside the model's range of validity.
    pub valid: bool,
    /// Why the run failed.
    pub reason: Option<String>,
    /// How long it took, in seconds.
    pub seconds: f64,
}

/// The table of the runs of a scenario.
pub(super) const TABLE: &str = "runs.csv";
const FOLDERS: &str = "scenarios.json";
const LOG: &str = "progress.jsonl";

impl Artifact for Simulated {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        let mut names = Vec::new();
        for made in &self.scenarios {
            let folder = inside(folder, &made.folder);
            files::write_atomic(&folder.join(TABLE), self.table(&made.runs).as_bytes())?;
            let seconds: String = std::iter::once("run,seconds\n".to_owned())
                .chain(made.runs.iter().map(|r| format!("{},{:.3}\n", r.run, r.seconds)))
                .collect();
            // Times differ from machine to machine: kept for people, not part of the result.
            files::write_atomic(&folder.join("seconds.csv"), seconds.as_bytes())?;
            names.push(made.folder.join(TABLE).display().to_string());
        }
        if self.scenarios.iter().any(|made| !made.folder.as_os_str().is_empty()) {
            let folders: Vec<&PathBuf> = self.scenarios.iter().map(|made| &made.folder).collect();
            files::write_json(&folder.join(FOLDERS), &folders)?;
            names.push(FOLDERS.to_owned());
        }
        Ok(names)
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        let folders: Vec<PathBuf> = if folder.join(FOLDERS).is_file() {
            files::read_json(&folder.join(FOLDERS))?
        } else {
            vec![PathBuf::new()]
        };
        let mut all =
            Self { scenarios: Vec::new(), parameters: Vec::new(), points: Matrix::default() };
        for inner in folders {
            let (runs, parameters, points) = from_table(&inside(folder, &inner).join(TABLE))?;
            all.scenarios.push(Made { folder: inner, runs });
            (all.parameters, all.points) = (parameters, points);
        }
        Ok(all)
    }
}

impl Simulated {
    /// `runs.csv`: `run`, `file`, `status`, `valid`, `reason`, `sha256` and one column a parameter.
    fn table(&self, runs: &[RunRecord]) -> String {
        let mut text =
            format!("run,file,status,valid,reason,sha256,{}\n", self.parameters.join(","));
        for (record, point) in runs.iter().zip(self.points.iter_rows()) {
            let status = if record.file.is_some() { "done" } else { "failed" };
            let reason = record.reason.as_deref().unwrap_or("").replace('"', "\"\"");
            let values: Vec<String> = point.iter().map(ToString::to_string).collect();
            text.push_str(&format!(
                "{},{},{status},{},\"{reason}\",{},{}\n",
                record.run,
                record.file.as_deref().unwrap_or(""),
                record.valid,
                record.sha256.as_deref().unwrap_or(""),
                values.join(",")
            ));
        }
        text
    }

    fn all(&self) -> impl Iterator<Item = &RunRecord> {
        self.scenarios.iter().flat_map(|made| &made.runs)
    }

    /// How many runs failed, those of all scenarios counted.
    pub fn failures(&self) -> usize {
        self.all().filter(|r| r.file.is_none()).count()
    }

    /// How many result files are missing or have changed.
    fn damaged(&self, folder: &Path) -> usize {
        let of = |made: &Made| {
            let folder = inside(folder, &made.folder);
            made.runs.iter().filter(|r| r.file.is_some() && !is_whole(r, &folder)).count()
        };
        self.scenarios.iter().map(of).sum()
    }
}

/// The runs of a table with the names and values of their parameters.
pub(super) fn from_table(path: &Path) -> Result<(Vec<RunRecord>, Vec<String>, Matrix), Stop> {
    let bad = |what: String| Stop::new(format!("cannot read {}: {what}", path.display()));
    let bytes = files::read(path)?;
    let mut reader = csv::Reader::from_reader(&bytes[..]);
    let header = reader.headers().map_err(|e| bad(e.to_string()))?.clone();
    let parameters: Vec<String> = header.iter().skip(6).map(str::to_owned).collect();
    let mut runs = Vec::new();
    let mut points = Matrix::zeros(0, parameters.len());
    for row in reader.records() {
        let row = row.map_err(|e| bad(e.to_string()))?;
        let some = |i: usize| row.get(i).filter(|t| !t.is_empty()).map(str::to_owned);
        runs.push(RunRecord {
            run: some(0).unwrap_or_default(),
            file: some(1),
            valid: row.get(3) == Some("true"),
            reason: some(4),
            sha256: some(5),
            seconds: 0.0,
        });
        let values: Result<Vec<f64>, _> = row.iter().skip(6).map(str::parse).collect();
        points.push_row(&values.map_err(|e| bad(format!("a parameter: {e}")))?);
    }
    Ok((runs, parameters, points))
}

/// The folder of a scenario's runs in that of all.
pub(super) fn inside(folder: &Path, own: &Path) -> PathBuf {
    if own.as_os_str().is_empty() { folder.to_owned() } else { folder.join(own) }
}

fn is_whole(record: &RunRecord, folder: &Path) -> bool {
    record.file.as_ref().is_some_and(|file| {
        files::hash_file(&folder.join(file)).is_ok_and(|hash| record.sha256.as_ref() == Some(&hash))
    })
}

/// Runs the simulator; `None` when the study has no design or no model.
pub fn stage(
    study: &Study,
    design: Option<&Kept<Design>>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<Simulated>>, Stop> {
    let (Some(design), Some(simulator)) = (design, Simulator::of(study)?) else { return Ok(None) };
    let Some(section) = &study.model else { return Ok(None) };
    let points = &design.value.points;
    let names = names(points.rows());
    let model = (section.built.name, &section.built.options, &section.common);
    let count = points.rows() * simulator.settings.len();
    observer.begin("simulate", "run", count as u64);
    let kept = kept(study, &simulator, STAGE, &names, points, &model, run, observer)?;
    observer.end("simulate", &summary(&kept.value));
    Ok(Some(kept))
}

/// The runs at some points as a stage of their own: taken when they are there, made when not, and
/// those that failed or lost their files made again.
#[expect(clippy::too_many_arguments, reason = "what runs, where, and what its hash is made of")]
pub fn kept(
    study: &Study,
    simulator: &Simulator<'_>,
    stage: &str,
    names: &[String],
    points: &Matrix,
    model: &impl Serialize,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Simulated>, Stop> {
    // In a study without scenarios the conditions say nothing.
    let asked: Vec<_> = simulator.settings.iter().map(|s| (&s.asked, s.scenario)).collect();
    let model_files: Vec<PathBuf> = simulator.model.files(simulator.study);
    let inputs = json!([names, points, model, asked, files::hash_sources(&model_files)?]);
    let folder = run.stage_folder(stage);
    let make = |folder: &Path| simulate(study, simulator, names, points, folder, observer);
    let kept = run.keep(stage, &inputs, observer, make)?;
    let damaged = if kept.fresh { 0 } else { kept.value.damaged(&folder) };
    if damaged > 0 {
        observer.warn(&format!(
            "result files in {} are missing or not as they were written ({damaged} of {}); making them again",
            folder.display(),
            names.len()
        ));
    }
    if damaged > 0 || (!kept.fresh && kept.value.failures() > 0) {
        run.reopen(stage)?;
        return run.keep(stage, &inputs, observer, make);
    }
    Ok(kept)
}

const STAGE: &str = "2-simulate";

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
    names: &[String],
    points: &Matrix,
    folder: &Path,
    observer: &dyn Observer,
) -> Result<Simulated, Stop> {
    let progress = Progress::new(observer);
    let mut scenarios = Vec::new();
    for setting in &simulator.settings {
        let folder = inside(folder, &setting.folder);
        fs::create_dir_all(&folder).map_err(|error| files::cannot_write(&folder, &error))?;
        let work = Work { study, simulator, setting, names, points, folder: &folder };
        scenarios.push(Made { folder: setting.folder.clone(), runs: work.run(&progress)? });
    }
    let parameters = simulator.unknowns.clone();
    Ok(Simulated { scenarios, parameters, points: points.clone() })
}

/// The runs of one scenario.
struct Work<'a> {
    study: &'a Study,
    simulator: &'a Simulator<'a>,
    setting: &'a Setting<'a>,
    names: &'a [String],
    points: &'a Matrix,
    folder: &'a Path,
}

impl Work<'_> {
    /// Makes the runs that are missing.
    fn run(&self, progress: &Progress<'_>) -> Result<Vec<RunRecord>, Stop> {
        let (names, folder) = (self.names, self.folder);
        let executor =
            self.study.executor.as_ref().ok_or_else(|| Stop::new("the study has no executor"))?;
        let mut ended = earlier(folder);
        ended.retain(|_, record| is_whole(record, folder));
        let missing: Vec<usize> =
            (0..names.len()).filter(|&i| !ended.contains_key(&names[i])).collect();
        progress.add((names.len() - missing.len()) as u64);
        let inputs = |i: usize| self.setting.inputs(self.points.row(i));
        let jobs: Vec<Job> =
            missing.iter().map(|&i| Job { name: names[i].clone(), inputs: inputs(i) }).collect();
        let log_path = folder.join(LOG);
        let mut log = OpenOptions::new()
            .create(true)
            .append(true)
            .open(&log_path)
            .map_err(|error| files::cannot_write(&log_path, &error))?;
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
        };
        let mut note = |finished: Finished| {
            let record = record(&jobs[finished.index].name, finished, folder)?;
            let line = serde_json::to_string(&record)
                .map_err(|e| Stop::new(format!("cannot note a finished run: {e}")))?;
            writeln!(log, "{line}").map_err(|error| files::cannot_write(&log_path, &error))?;
            ended.insert(record.run.clone(), record);
            progress.add(1);
            Ok(())
        };
        let submitted = executor.built.plugin.submit(&batch, &mut note);
        submitted.map_err(|stop| {
            let done = names.len() - missing.len()
                + jobs.iter().filter(|j| ended.contains_key(&j.name)).count();
            stop.saved(format!("{done} of {} runs in {}", names.len(), folder.display()))
        })?;
        let runs: Option<Vec<RunRecord>> = names.iter().map(|name| ended.remove(name)).collect();
        runs.ok_or_else(|| Stop::new("the executor left runs out"))
    }
}

/// `run001`, `run002`, …, with as many digits as the last one needs.
pub fn names(count: usize) -> Vec<String> {
    let digits = count.to_string().len().max(3);
    (1..=count).map(|i| format!("run{i:0digits$}")).collect()
}

/// What an earlier, interrupted attempt noted; the last word on each run counts.
fn earlier(folder: &Path) -> BTreeMap<String, RunRecord> {
    let text = fs::read_to_string(folder.join(LOG)).unwrap_or_default();
    text.lines()
        .filter_map(|line| serde_json::from_str::<RunRecord>(line).ok())
        .map(|record| (record.run.clone(), record))
        .collect()
}

fn record(run: &str, finished: Finished, folder: &Path) -> Result<RunRecord, Stop> {
    let run = run.to_owned();
    let seconds = finished.seconds;
    Ok(match finished.outcome {
        Ok(Written { file, valid }) => {
            let sha256 = Some(files::hash_file(&folder.join(&file))?);
            RunRecord { run, file: Some(file), sha256, valid, reason: None, seconds }
        }
        Err(reason) => {
            // One line a run in the table.
            let reason = Some(reason.replace(['\n', '\r'], "; "));
            RunRecord { run, file: None, sha256: None, valid: false, reason, seconds }
        }
    })
}
