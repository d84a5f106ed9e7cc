//! Log of the finished cases of a run, one per line.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use lacuna::run::{Stop, files};

use super::Tried;
use crate::stage::cases::Outcome;

const FILE: &str = "cases.jsonl";

/// Finished cases, in memory and in a file.
pub struct Log {
    path: PathBuf,
    inside: Mutex<(BTreeMap<usize, Tried>, File)>,
}

impl Log {
    /// Opens the log of a folder with its cases. An incomplete last line is ignored, and a case that is
    /// not settled is repeated.
    pub fn open(folder: &Path) -> Result<Self, Stop> {
        let path = folder.join(FILE);
        let text = if path.exists() {
            String::from_utf8_lossy(&files::read(&path)?).into_owned()
        } else {
            String::new()
        };
        let cases = text.lines().filter_map(|line| serde_json::from_str::<Tried>(line).ok());
        let done = cases.filter(Outcome::is_settled);
        let done = done.map(|tried| (tried.case.number, tried)).collect();
        let cannot = |error: std::io::Error| files::cannot_write(&path, &error);
        let mut file = OpenOptions::new().create(true).append(true).open(&path).map_err(cannot)?;
        if !text.is_empty() && !text.ends_with('\n') {
            file.write_all(b"\n").map_err(cannot)?;
        }
        Ok(Self { inside: Mutex::new((done, file)), path })
    }

    /// Returns true if a case is finished.
    pub fn has(&self, number: usize) -> bool {
        self.inside.lock().unwrap_or_else(PoisonError::into_inner).0.contains_key(&number)
    }

    /// Records a case.
    pub fn note(&self, number: usize, tried: Tried) -> Result<(), Stop> {
        let line = serde_json::to_string(&tried)
            .map_err(|error| Stop::new(format!("case {number} cannot be written: {error}")))?;
        let mut inside = self.inside.lock().unwrap_or_else(PoisonError::into_inner);
        let written = inside.1.write_all(format!("{line}\n").as_bytes());
        written.map_err(|error| files::cannot_write(&self.path, &error))?;
        inside.0.insert(number, tried);
        Ok(())
    }

    /// All cases, by number.
    pub fn into_cases(self) -> Vec<Tried> {
        let inside = self.inside.into_inner().unwrap_or_else(PoisonError::into_inner);
        inside.0.into_values().collect()
    }
}
