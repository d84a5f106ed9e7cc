//! The folder that is served: one run directory, or a folder of them.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use lacuna::run::{Stop, files};

use super::row::{self, RunRow};
use super::watched::Watched;
use crate::assess::Assessment;

/// File that every run directory has.
const MARK: &str = "resolved.toml";
/// Shortest time after which a run is looked at again.
const SHORTEST: Duration = Duration::from_millis(300);
/// Part of the time that is spent at most on looking at a run, as its inverse.
const REST: u32 = 10;

/// A run directory, or a folder of run directories, that is served.
pub struct ServedFolder {
    /// Folder, without symbolic links.
    root: PathBuf,
    /// Name of the only run; `None` for a folder of runs.
    only: Option<String>,
    looked: Mutex<BTreeMap<String, Looked>>,
}

/// Name by which a folder with this name has an address: without what `address::parts` refuses.
fn named(folder: &str) -> String {
    let is_sound = |c: &char| !matches!(c, '/' | '\\' | ':') && !c.is_control();
    let name: String = folder.trim_start_matches('.').chars().filter(is_sound).collect();
    if name.is_empty() { "run".to_owned() } else { name }
}

/// Result of a look at a run.
struct Looked {
    found: Arc<Watched>,
    at: Instant,
    /// Time that the look took.
    took: Duration,
}

impl ServedFolder {
    /// Opens a run directory, or a folder whose subfolders are run directories; there may be none yet.
    pub fn open(path: &Path) -> Result<Self, Stop> {
        let root = path.canonicalize().map_err(|error| {
            files::cannot_read(path, &error)
                .help("give a run directory, or the folder that holds them, such as `runs`")
        })?;
        if !root.is_dir() {
            let stop = Stop::new(format!("{} is no folder", path.display()));
            return Err(stop.help("give a run directory, or the folder that holds them"));
        }
        let only = root.join(MARK).is_file().then(|| match root.file_name() {
            Some(name) => named(&name.to_string_lossy()),
            None => named(""),
        });
        Ok(Self { root, only, looked: Mutex::default() })
    }

    /// Path of the folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Name of the run if only one is served.
    pub fn only(&self) -> Option<&str> {
        self.only.as_deref()
    }

    /// Names of the runs, sorted.
    pub fn names(&self) -> Vec<String> {
        if let Some(only) = &self.only {
            return vec![only.clone()];
        }
        let entries = fs::read_dir(&self.root).into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
        let mut names: Vec<String> = names.filter(|name| self.run(name).is_some()).collect();
        names.sort();
        names
    }

    /// Directory of a run; `None` if there is no such run, or if it is a link that leads out of the folder.
    pub fn run(&self, name: &str) -> Option<PathBuf> {
        if let Some(only) = &self.only {
            return (only == name).then(|| self.root.clone());
        }
        let is_name = !name.is_empty() && !name.starts_with('.') && !name.contains(['/', '\\']);
        let path = is_name.then(|| self.root.join(name).canonicalize().ok()).flatten()?;
        (path.starts_with(&self.root) && path != self.root && path.join(MARK).is_file())
            .then_some(path)
    }

    /// A file of a run and its length; `None` if there is none, or if it lies outside of the directory of the run.
    pub(super) fn file(&self, run: &str, parts: &[String]) -> Option<(File, u64)> {
        let directory = self.run(run)?;
        let path = parts.iter().fold(directory.clone(), |path, part| path.join(part));
        let path = path.canonicalize().ok()?;
        // A pipe would wait for somebody who writes to it.
        if !path.starts_with(&directory) || !path.is_file() {
            return None;
        }
        let file = File::open(&path).ok()?;
        let length = file.metadata().ok().filter(fs::Metadata::is_file)?.len();
        Some((file, length))
    }

    /// Assessment of the result of a run; `None` if there is none.
    pub(super) fn assessment(&self, run: &str) -> Option<Assessment> {
        row::assessment(&row::summary(&self.run(run)?))
    }

    /// Rows of all runs.
    pub fn rows(&self) -> Vec<RunRow> {
        let row = |name: String| Some(RunRow::read(&self.run(&name)?, &name));
        self.names().into_iter().filter_map(row).collect()
    }

    /// State of a run in detail; `None` if there is no such run.
    ///
    /// Looks at the same run are spaced out, so that looking takes at most a tenth of the time however many draws or runs
    /// there are.
    pub fn watched(&self, name: &str) -> Option<Arc<Watched>> {
        let directory = self.run(name)?;
        let mut looked = self.looked.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(last) = looked.get(name)
            && last.at.elapsed() < SHORTEST.max(REST * last.took)
        {
            return Some(Arc::clone(&last.found));
        }
        let begun = Instant::now();
        let found = Arc::new(Watched::read(&directory, name));
        let (at, took) = (Instant::now(), begun.elapsed());
        looked.insert(name.to_owned(), Looked { found: Arc::clone(&found), at, took });
        Some(found)
    }
}
