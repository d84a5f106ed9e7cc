//! The campaign table of a run: how many simulation runs are in which state, and which ones are not done.

use std::path::Path;

use serde::Serialize;

use crate::campaign::{Row, State, status_on_disk};

/// Simulation runs of a run directory.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CampaignTable {
    /// Numbers of runs by stage and scenario.
    pub counts: Vec<CampaignCounts>,
    /// Runs that are not done.
    pub open: Vec<Row>,
    /// Warnings to show first.
    pub warnings: Vec<String>,
}

/// Numbers of runs of one stage and scenario.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CampaignCounts {
    /// Folder of the stage.
    pub stage: String,
    /// Name of the scenario; empty in a study without scenarios.
    pub scenario: String,
    /// Number of requested runs.
    pub runs: usize,
    /// Number of runs in each state, in the order of [`State::ALL`].
    #[serde(flatten, serialize_with = "by_name")]
    pub states: [usize; 5],
    /// Mean time of the runs that are done, in seconds; `None` if there are none.
    pub mean_seconds: Option<f64>,
}

fn by_name<S: serde::Serializer>(states: &[usize; 5], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(State::ALL.iter().map(|state| state.name()).zip(states))
}

impl CampaignTable {
    /// Reads the state of the runs in a run directory, without asking a scheduler; `busy` is true if a process works there.
    /// `None` if no runs have been requested.
    pub(super) fn read(root: &Path, busy: bool) -> Option<Self> {
        let status = match status_on_disk(root, busy) {
            Ok(status) => status,
            Err(stop) => {
                let warnings = vec![stop.to_string()];
                return Some(Self { counts: Vec::new(), open: Vec::new(), warnings });
            }
        };
        let groups =
            status.runs.chunk_by(|a, b| (&a.stage, &a.scenario) == (&b.stage, &b.scenario));
        let counts: Vec<CampaignCounts> = groups.filter_map(CampaignCounts::of).collect();
        let open = status.runs.into_iter().filter(|row| row.state != State::Done).collect();
        let table = Self { counts, open, warnings: status.warnings };
        (!table.counts.is_empty() || !table.warnings.is_empty()).then_some(table)
    }
}

impl CampaignCounts {
    fn of(rows: &[Row]) -> Option<Self> {
        let first = rows.first()?;
        let count = |state: State| rows.iter().filter(|row| row.state == state).count();
        let seconds: Vec<f64> = rows.iter().filter_map(|row| row.seconds).collect();
        let mean = seconds.iter().sum::<f64>() / seconds.len() as f64;
        Some(Self {
            stage: first.stage.clone(),
            scenario: first.scenario.clone(),
            runs: rows.len(),
            states: State::ALL.map(count),
            mean_seconds: (!seconds.is_empty()).then_some(mean),
        })
    }
}
