//! One run in the list of runs.

use std::fs;
use std::path::Path;
use std::time::UNIX_EPOCH;

use lacuna::run::files;
use lacuna_run::RunDirectory;
use lacuna_run::progress::Present;
use lacuna_run::seen::{SeenStage, stages};
use serde::{Deserialize as _, Serialize};
use serde_json::Value;

use crate::assess::{Assessment, Level};

/// State of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RunState {
    /// A process works in its directory.
    Running,
    /// All stages are finished.
    Finished,
    /// No process works in its directory, and stages are missing.
    Stopped,
}

impl RunState {
    /// Name of the state.
    pub fn name(self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Finished => "finished",
            Self::Stopped => "stopped",
        }
    }
}

/// A run in the list of runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunRow {
    /// Name of the run: that of its folder.
    pub name: String,
    /// Name of the study.
    pub study: String,
    /// Title of the study.
    pub title: String,
    /// State of the run.
    pub state: RunState,
    /// Label of the stage that is being made, or that was being made when the run stopped; `None` for a finished run and
    /// if it is not known.
    pub stage: Option<String>,
    /// Share of this stage that is done, if its end is known.
    pub share: Option<f64>,
    /// Level of trust in the result of a finished run.
    pub level: Option<Level>,
    /// The assessment of a finished run in a few words, or the reason why a run stopped.
    pub verdict: Option<String>,
    /// Posterior of the parameters of a finished run.
    pub parameters: Vec<Estimate>,
    /// Time spent on the finished stages, in seconds.
    pub seconds: f64,
    /// Time of the last change of its state that is known, in seconds since 1970 (UTC).
    pub changed: u64,
}

/// Posterior of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    /// Name of the parameter.
    pub name: String,
    /// Unit of the parameter.
    pub unit: String,
    /// Posterior mean.
    pub mean: f64,
    /// Posterior standard deviation.
    pub sd: f64,
}

impl RunRow {
    /// Reads the row of the run in this directory.
    pub fn read(root: &Path, name: &str) -> Self {
        let present = Present::read(root);
        Self::of(root, name, &stages(root), present.as_ref(), &summary(root))
    }

    /// The row of a run, from what was read of its directory.
    pub(super) fn of(
        root: &Path,
        name: &str,
        stages: &[SeenStage],
        present: Option<&Present>,
        summary: &Value,
    ) -> Self {
        let state = state(root, present);
        let finished = state == RunState::Finished;
        let (study, title) = about(root);
        let stage = present.map(|p| p.stage.clone()).filter(|stage| !stage.is_empty());
        let stage = stage.or_else(|| {
            let open = stages.iter().rev().find(|stage| stage.record.is_none());
            open.map(|stage| label(&stage.folder).to_owned())
        });
        let assessment = assessment(summary).filter(|_| finished);
        let said = assessment.as_ref().map(Assessment::line);
        let share = present.filter(|p| p.total > 0).map(|p| p.done as f64 / p.total as f64);
        let ends = stages.iter().filter_map(|stage| Some(stage.record.as_ref()?.finished));
        let written = present.map(|p| p.written);
        Self {
            name: name.to_owned(),
            study,
            title,
            state,
            stage: stage.filter(|_| !finished),
            share: share.map(|share| share.min(1.0)),
            level: assessment.map(|assessment| assessment.level),
            verdict: said.or_else(|| present.and_then(|p| p.stopped.clone())),
            parameters: if finished { estimates(summary) } else { Vec::new() },
            seconds: stages.iter().filter_map(|s| Some(s.record.as_ref()?.seconds)).sum(),
            changed: ends.chain(written).chain(modified(&root.join(MANIFEST))).max().unwrap_or(0),
        }
    }
}

/// File that is written when a run has finished.
const MANIFEST: &str = "manifest.json";

/// Assessment in a summary; `None` if there is none.
pub(super) fn assessment(summary: &Value) -> Option<Assessment> {
    Assessment::deserialize(summary.get("assessment")?).ok()
}

/// The results of a run; null if there are none.
pub(super) fn summary(root: &Path) -> Value {
    files::read_json(&root.join("summary.json")).unwrap_or(Value::Null)
}

/// State of a run. The record of its progress is there from its beginning to its end, so that a second attempt with other
/// settings is not finished because the first one was.
fn state(root: &Path, present: Option<&Present>) -> RunState {
    if RunDirectory::is_busy(root) {
        RunState::Running
    } else if present.is_none() && root.join(MANIFEST).is_file() {
        RunState::Finished
    } else {
        RunState::Stopped
    }
}

/// Name and title of the study.
fn about(root: &Path) -> (String, String) {
    let text = fs::read_to_string(root.join("resolved.toml")).unwrap_or_default();
    let resolved: toml::Table = text.parse().unwrap_or_default();
    let word = |key: &str| Some(resolved.get("study")?.get(key)?.as_str()?.to_owned());
    (word("name").unwrap_or_default(), word("title").unwrap_or_default())
}

/// Label of a stage from the name of its folder.
pub(super) fn label(folder: &str) -> &str {
    folder.split_once('-').map_or(folder, |(_, label)| label)
}

fn estimates(summary: &Value) -> Vec<Estimate> {
    let parameters = summary.get("parameters").and_then(Value::as_object);
    let one = |(name, found): (&String, &Value)| {
        let number = |key: &str| found.get(key).and_then(Value::as_f64);
        let word = |key: &str| found.get(key).and_then(Value::as_str).unwrap_or_default();
        if word("role") != "parameter" {
            return None;
        }
        let (mean, sd) = (number("mean")?, number("sd")?);
        Some(Estimate { name: name.clone(), unit: word("unit").to_owned(), mean, sd })
    };
    parameters.into_iter().flatten().filter_map(one).collect()
}

fn modified(path: &Path) -> Option<u64> {
    let time = fs::metadata(path).and_then(|found| found.modified()).ok()?;
    Some(time.duration_since(UNIX_EPOCH).ok()?.as_secs())
}
