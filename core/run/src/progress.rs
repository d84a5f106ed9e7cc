//! The file `progress.json` of an unfinished run: what is being done, for other processes that look at the run directory.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use lacuna::run::{Observer, Stop, files};
use serde::{Deserialize, Serialize};

const FILE: &str = "progress.json";

/// Smallest time between two writes while a stage advances.
const INTERVAL: Duration = Duration::from_millis(500);
/// Largest number of stages that have ended, and of warnings, that are kept.
const MOST: usize = 50;

/// Progress of an unfinished run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Present {
    /// Label of the stage that is being made, such as `calibrate`; empty between two stages.
    pub stage: String,
    /// Name of a unit of its work, such as `step`; empty if they are not counted.
    pub unit: String,
    /// Number of units that are done.
    pub done: u64,
    /// Number of units in all; zero if it is not known.
    pub total: u64,
    /// True if that number is an estimate.
    #[serde(default)]
    pub about: bool,
    /// Time at which the stage began, in seconds since 1970 (UTC).
    pub begun: u64,
    /// Time at which this was written, in seconds since 1970 (UTC).
    pub written: u64,
    /// Stages of this attempt that have ended, the latest last.
    pub ended: Vec<EndedStage>,
    /// Warnings of this attempt, the latest last.
    pub warnings: Vec<String>,
    /// Reason why the run has stopped; `None` while it goes on, and if the process was killed.
    pub stopped: Option<String>,
}

/// A stage that has ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct EndedStage {
    /// Label of the stage.
    pub stage: String,
    /// Result of the stage in a few words.
    pub note: String,
}

impl Present {
    /// Reads the progress of the run in this folder; `None` if the run is finished, or has not begun.
    pub fn read(root: &Path) -> Option<Self> {
        files::read_json(&root.join(FILE)).ok()
    }
}

/// An observer that writes the progress of a run into its directory, and forwards everything to another one.
pub struct Recorded<'a> {
    path: PathBuf,
    observer: &'a dyn Observer,
    inside: Mutex<(Present, Instant)>,
}

impl<'a> Recorded<'a> {
    /// Begins the record of a run in this folder.
    pub fn new(root: &Path, observer: &'a dyn Observer) -> Self {
        let recorded = Self {
            path: root.join(FILE),
            observer,
            inside: Mutex::new((Present::default(), Instant::now())),
        };
        recorded.change(|_| {});
        recorded
    }

    /// Ends the record: it is removed if the run is finished, otherwise it keeps the reason why the run stopped.
    pub fn finish<T>(self, result: &Result<T, Stop>) {
        match result {
            // What cannot be removed is out of date, and the run is finished nevertheless.
            Ok(_) => drop(fs::remove_file(&self.path)),
            Err(stop) => self.change(|present| present.stopped = Some(stop.to_string())),
        }
    }

    fn change(&self, act: impl FnOnce(&mut Present)) {
        let mut inside = self.inside.lock().unwrap_or_else(PoisonError::into_inner);
        act(&mut inside.0);
        inside.0.written = now();
        inside.1 = Instant::now();
        write(&self.path, &inside.0);
    }
}

/// Writes the file completely or not at all, without waiting for the disk: nothing depends on it. For the same reason a file
/// that cannot be written stops no run.
fn write(path: &Path, present: &Present) {
    let temporary = path.with_file_name(format!(".{FILE}.part"));
    let Ok(text) = serde_json::to_vec(present) else { return };
    if fs::write(&temporary, text).and_then(|()| fs::rename(&temporary, path)).is_err() {
        let _ = fs::remove_file(&temporary);
    }
}

fn now() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |elapsed| elapsed.as_secs())
}

/// Appends to a list of limited length, without repetition.
fn note<T: PartialEq>(list: &mut Vec<T>, new: T) {
    list.retain(|one| *one != new);
    if list.len() >= MOST {
        list.remove(0);
    }
    list.push(new);
}

impl Observer for Recorded<'_> {
    fn begin(&self, stage: &str, unit: &str, total: u64) {
        self.change(|present| {
            let (stage, unit) = (stage.to_owned(), unit.to_owned());
            let (ended, warnings) =
                (std::mem::take(&mut present.ended), std::mem::take(&mut present.warnings));
            *present =
                Present { stage, unit, total, begun: now(), ended, warnings, ..Present::default() };
        });
        self.observer.begin(stage, unit, total);
    }

    fn advance(&self, done: u64) {
        // Threads that advance at the same time need not wait for each other: the next one writes.
        if let Ok(mut inside) = self.inside.try_lock() {
            inside.0.done = inside.0.done.max(done);
            if inside.1.elapsed() > INTERVAL {
                inside.0.written = now();
                inside.1 = Instant::now();
                write(&self.path, &inside.0);
            }
        }
        self.observer.advance(done);
    }

    fn expect(&self, total: u64) {
        self.change(|present| (present.total, present.about) = (total, true));
        self.observer.expect(total);
    }

    fn end(&self, stage: &str, text: &str) {
        self.change(|present| {
            note(&mut present.ended, EndedStage { stage: stage.to_owned(), note: text.to_owned() });
            (present.stage, present.unit) = (String::new(), String::new());
            (present.done, present.total, present.about) = (0, 0, false);
        });
        self.observer.end(stage, text);
    }

    fn warn(&self, text: &str) {
        self.change(|present| note(&mut present.warnings, text.to_owned()));
        self.observer.warn(text);
    }

    fn note(&self, text: &str) {
        self.observer.note(text);
    }

    fn remark(&self, text: &str) {
        self.change(|present| note(&mut present.warnings, text.to_owned()));
        self.observer.remark(text);
    }

    fn heard(&self) -> Vec<String> {
        self.observer.heard()
    }

    fn recall(&self, text: &str) {
        self.observer.recall(text);
    }
}

#[cfg(test)]
mod tests {
    use lacuna::run::Silent;

    use super::*;

    #[test]
    fn the_file_tells_what_is_done_until_the_run_ends() {
        let folder = tempfile::tempdir().unwrap();
        let recorded = Recorded::new(folder.path(), &Silent);
        recorded.begin("simulate", "run", 40);
        recorded.advance(3);
        let read = || Present::read(folder.path()).unwrap();
        assert_eq!((read().stage.as_str(), read().done, read().total), ("simulate", 0, 40));
        std::thread::sleep(INTERVAL);
        recorded.advance(5);
        recorded.advance(4);
        assert_eq!(read().done, 5);
        recorded.warn("run 7 has no answer");
        recorded.warn("run 7 has no answer");
        recorded.end("simulate", "39 of 40");
        recorded.begin("gap", "evaluation", 0);
        recorded.expect(900);
        assert_eq!((read().total, read().about), (900, true));
        recorded.end("gap", "nothing is missing");
        recorded.begin("surrogate", "", 0);
        let present = read();
        assert_eq!((present.total, present.about), (0, false));
        assert_eq!((present.stage.as_str(), present.done), ("surrogate", 0));
        assert_eq!(present.warnings, ["run 7 has no answer"]);
        assert_eq!((present.ended.len(), present.ended[0].note.as_str()), (2, "39 of 40"));
        recorded.finish::<()>(&Err(Stop::new("the disk is full")));
        assert_eq!(read().stopped.as_deref(), Some("the disk is full"));
        Recorded::new(folder.path(), &Silent).finish(&Ok(()));
        assert_eq!(Present::read(folder.path()), None);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
