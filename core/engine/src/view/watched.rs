//! One run in detail.

use std::fs;
use std::path::Path;

use lacuna_run::progress::Present;
use lacuna_run::seen::{SeenStage, stages};
use serde::Serialize;

use super::campaign::CampaignTable;
use super::gap::GapProgress;
use super::row::{RunRow, RunState, summary};
use super::sampling::Sampling;

/// Version of the keys of the JSON and of their meaning.
pub const SCHEMA: u64 = 1;

/// State of a run in detail.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Watched {
    /// Version of the keys and of their meaning.
    pub schema: u64,
    /// The run as in the list of runs.
    #[serde(flatten)]
    pub row: RunRow,
    /// Stages that have begun, in the order of their folders.
    pub stages: Vec<StageRow>,
    /// Progress of an unfinished run; `None` if it is not recorded.
    pub progress: Option<Present>,
    /// Chains of an unfinished run up to their last checkpoint; `None` if there is none.
    pub sampling: Option<Sampling>,
    /// Simulation runs; `None` if none are requested.
    pub campaign: Option<CampaignTable>,
    /// Gap search; `None` if none has begun.
    pub gap: Option<GapProgress>,
    /// Files with results, as paths inside the run directory.
    pub files: Vec<String>,
    /// Names of the figures in `figures`.
    pub figures: Vec<String>,
}

/// A stage that has begun.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageRow {
    /// Name of its folder.
    pub folder: String,
    /// True if it is finished.
    pub finished: bool,
    /// Time at which it was begun, in seconds since 1970 (UTC).
    pub begun: u64,
    /// Duration of the finished stage, in seconds.
    pub seconds: Option<f64>,
    /// Version of Lacuna that made its result.
    pub lacuna: Option<String>,
    /// Warnings that were given while its result was made.
    pub warnings: Vec<String>,
}

/// Files with results that are listed if they exist.
const FILES: [&str; 11] = [
    "report.html",
    "7-power/power.html",
    "7-coverage/coverage.html",
    "summary.json",
    "posterior.nc",
    "study.toml",
    "resolved.toml",
    "manifest.json",
    "7-gap/gap.toml",
    "7-gap/added.toml",
    "7-show/show.toml",
];

impl Watched {
    /// Reads the state of the run in this directory.
    pub fn read(root: &Path, name: &str) -> Self {
        let present = Present::read(root);
        let stages = stages(root);
        let row = RunRow::of(root, name, &stages, present.as_ref(), &summary(root));
        let state = row.state;
        let open = state != RunState::Finished;
        Self {
            schema: SCHEMA,
            sampling: if open { Sampling::read(root, &stages) } else { None },
            campaign: CampaignTable::read(root, state == RunState::Running),
            gap: GapProgress::read(root, &stages, state),
            stages: stages.iter().map(StageRow::of).collect(),
            progress: present.filter(|_| open),
            files: FILES
                .iter()
                .filter(|file| root.join(file).is_file())
                .map(|f| (*f).to_owned())
                .collect(),
            figures: figures(root),
            row,
        }
    }
}

impl StageRow {
    fn of(seen: &SeenStage) -> Self {
        let record = seen.record.as_ref();
        Self {
            folder: seen.folder.clone(),
            finished: record.is_some(),
            begun: seen.begun,
            seconds: record.map(|record| record.seconds),
            lacuna: record.map(|record| record.lacuna.clone()),
            warnings: record.map(|record| record.warnings.clone()).unwrap_or_default(),
        }
    }
}

fn figures(root: &Path) -> Vec<String> {
    let entries = fs::read_dir(root.join("figures")).into_iter().flatten().flatten();
    let name =
        |entry: fs::DirEntry| entry.file_name().to_str()?.strip_suffix(".svg").map(str::to_owned);
    let mut names: Vec<String> = entries.filter_map(name).collect();
    names.sort();
    names
}
