//! The gap search of a run, as far as it is on disk.

use std::path::Path;

use lacuna_run::seen::SeenStage;
use lacuna_run::{Artifact as _, Stage};
use serde::Serialize;

use crate::gap::result::GapResult;
use crate::gap::stage::summary;

use super::row::RunState;

/// State of a gap search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum GapState {
    /// The search goes on.
    Searching,
    /// The search was interrupted.
    Stopped,
    /// The search has a result.
    Finished,
}

/// The gap search of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GapProgress {
    /// State of the search.
    pub state: GapState,
    /// Time at which it began, in seconds since 1970 (UTC).
    pub begun: u64,
    /// Verdict of the finished search in a few words.
    pub verdict: Option<String>,
    /// Reasons for the verdict.
    pub reasons: Vec<String>,
    /// Folders of the parts of the search, such as the runs of released inputs, and whether they are finished.
    pub parts: Vec<(String, bool)>,
}

impl GapProgress {
    /// Reads the state of the gap search; `None` if none has begun.
    pub(super) fn read(root: &Path, stages: &[SeenStage], run: RunState) -> Option<Self> {
        let name = Stage::Gap.folder().name().to_owned();
        let begins = format!("{name}-");
        let parts = stages.iter().filter(|stage| stage.folder.starts_with(&begins));
        let parts: Vec<(String, bool)> =
            parts.map(|stage| (stage.folder.clone(), stage.record.is_some())).collect();
        let own = stages.iter().find(|stage| stage.folder == name);
        let first = stages.iter().find(|stage| stage.folder.starts_with(&begins));
        let begun = own.or(first)?.begun;
        let found = own.filter(|own| own.record.is_some());
        let found = found.and_then(|_| GapResult::load(&root.join(&name)).ok());
        let state = match (&found, run) {
            (Some(_), _) => GapState::Finished,
            (None, RunState::Running) => GapState::Searching,
            (None, _) => GapState::Stopped,
        };
        Some(Self {
            state,
            begun,
            verdict: found.as_ref().map(summary),
            reasons: found.map(|found| found.verdict.reasons).unwrap_or_default(),
            parts,
        })
    }
}
