//! The run directory and its word [`RunDirectory::keep`]: cache, resume and provenance in one.

use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use super::made_by::{Asked, MadeBy};
use super::{Observer, Stop, files};
use crate::plugin::Fault;

/// The result of a stage that can be kept in files.
pub trait Artifact: Sized {
    /// Writes the result into the stage's folder and returns the names of the files that hold it.
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop>;

    /// Reads the result from the stage's folder.
    fn load(folder: &Path) -> Result<Self, Stop>;
}

/// A finished stage.
#[derive(Debug, Clone)]
pub struct Kept<T> {
    /// The result.
    pub value: T,
    /// The hash of the files that hold it, for the stages that build on it.
    pub hash: String,
    /// How long it took when it was made, in seconds.
    pub seconds: f64,
    /// Whether it was made just now.
    pub fresh: bool,
}

/// What is recorded of a finished stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// The stage's folder.
    pub stage: String,
    /// The hash of everything that went in, and of what made it.
    pub inputs: String,
    /// The hash of everything that went in alone; the same as `inputs` where no code has a part in it.
    #[serde(default)]
    pub asked: Option<String>,
    /// What made it, as far as it depends on that.
    #[serde(default)]
    pub made_by: MadeBy,
    /// The SHA-256 of each file that came out.
    pub outputs: BTreeMap<String, String>,
    /// How long it took, in seconds.
    pub seconds: f64,
    /// The version of Lacuna that made it.
    pub lacuna: String,
    /// When it was finished, in seconds since 1970 (UTC).
    pub finished: u64,
    /// What was told while it was made.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

impl Record {
    /// Whether it was made from inputs of this hash, whatever made it. A record from before this was written down has
    /// that hash as its only one.
    pub(super) fn is_of(&self, alone: &str) -> bool {
        self.asked.as_ref().unwrap_or(&self.inputs) == alone
    }

    fn hash(&self) -> String {
        let lines: String =
            self.outputs.iter().map(|(file, hash)| format!("{hash} {file}\n")).collect();
        files::hash(lines.as_bytes())
    }
}

/// A folder that holds all artifacts of a study's run.
#[derive(Debug)]
pub struct RunDirectory {
    pub(super) root: PathBuf,
    records: Vec<Record>,
    watched: Vec<Arc<Fault>>,
    pub(super) version: String,
    /// Whether a stage was made again because another version had made it.
    pub(super) remade: bool,
    /// Whether results are taken whatever made them.
    pub(super) looking: bool,
    _lock: File,
}

/// Takes the lock, waiting a moment for a process that is about to let it go.
fn locked(lock: &File) -> bool {
    (0..20).any(|attempt| {
        if attempt > 0 {
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        !is_taken(&lock.try_lock())
    })
}

/// Whether another process has a lock. A file system without locks, such as Lustre mounted without `flock`, cannot tell:
/// that is no reason to refuse work there.
fn is_taken(tried: &Result<(), TryLockError>) -> bool {
    matches!(tried, Err(TryLockError::WouldBlock))
}

pub(super) const RECORD: &str = "stage.json";
pub(super) const INPUTS: &str = "inputs.sha256";

/// The hash that the folder of a stage is for: of the stage's inputs and of what makes it; empty where there is none.
pub fn inputs_of(folder: &Path) -> String {
    fs::read_to_string(folder.join(INPUTS)).unwrap_or_default().trim().to_owned()
}

impl RunDirectory {
    /// Opens or makes the folder and locks it against other processes.
    pub fn open(root: &Path) -> Result<Self, Stop> {
        fs::create_dir_all(root).map_err(|error| files::cannot_write(root, &error))?;
        let lock_path = root.join(".lock");
        let lock =
            File::create(&lock_path).map_err(|error| files::cannot_write(&lock_path, &error))?;
        if !locked(&lock) {
            let message = format!("another process is working in {}", root.display());
            return Err(
                Stop::new(message).help("wait for it, or choose another folder with `--out DIR`")
            );
        }
        Ok(Self {
            root: root.to_owned(),
            records: Vec::new(),
            watched: Vec::new(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            remade: false,
            looking: false,
            _lock: lock,
        })
    }

    /// Whether a process works in a folder.
    pub fn is_busy(root: &Path) -> bool {
        let lock = File::options().write(true).open(root.join(".lock"));
        lock.is_ok_and(|lock| is_taken(&lock.try_lock()))
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The records of the stages that were kept or made, in order.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// Keeps no result of a stage during which one of these had a fault.
    pub fn watch(&mut self, faults: Vec<Arc<Fault>>) {
        self.watched = faults;
    }

    /// Takes what is finished whatever version made it: to look at a finished run is no reason to make it again.
    pub fn look(&mut self) {
        self.looking = true;
    }

    /// Works as another version of the program, for tests of what that changes.
    #[doc(hidden)]
    pub fn pretend(&mut self, version: &str) {
        version.clone_into(&mut self.version);
    }

    /// The folder of a stage.
    pub fn stage_folder(&self, stage: &str) -> PathBuf {
        self.root.join(stage)
    }

    /// Returns the stage's saved result when the hash of its `inputs` and of [what makes it](MadeBy) is unchanged; else
    /// makes and saves it. What another version made is told: what is taken of it, and what is made again and why.
    ///
    /// `make` gets the stage's folder; what it wrote there in an earlier, interrupted attempt with the same
    /// inputs is still there, so that it can go on. A folder made from other inputs is set aside, not deleted,
    /// and taken back when the study returns to those inputs.
    pub fn keep<T: Artifact>(
        &mut self,
        stage: &str,
        inputs: &impl Serialize,
        observer: &dyn Observer,
        make: impl FnOnce(&Path) -> Result<T, Stop>,
    ) -> Result<Kept<T>, Stop> {
        let Asked { alone, whole: inputs, made_by } = Asked::of(stage, inputs, &self.version)?;
        let folder = self.stage_folder(stage);
        let inputs = self.looked_at(stage, &alone).unwrap_or(inputs);
        let before = self.made_otherwise(stage, &alone, &inputs, &made_by);
        self.bring_folder(stage, &inputs)?;
        match finished(&folder, &inputs) {
            Finished::Whole(record) => match T::load(&folder) {
                Ok(value) => {
                    if record.lacuna != self.version {
                        let made = &record.lacuna;
                        observer.note(&format!("`{stage}` is taken as lacuna {made} made it"));
                    }
                    record.warnings.iter().for_each(|text| observer.recall(text));
                    return Ok(self.kept(record, value, false));
                }
                Err(_) => observer.remark(&format!(
                    "the files in {} do not read back; making them again",
                    folder.display()
                )),
            },
            Finished::Changed(file) => observer.remark(&format!(
                "{} is missing or not as it was written; making it again",
                folder.join(file).display()
            )),
            Finished::No => {
                if let Some(why) = before {
                    self.remade = true;
                    observer.note(&format!("`{stage}` is made again: {why}"));
                }
            }
        }
        let begun = Instant::now();
        let before = observer.heard().len();
        let made = make(&folder);
        // What went wrong first explains more than what followed from it.
        if let Some(said) = self.watched.iter().find_map(|fault| fault.said()) {
            return Err(Stop::new(said));
        }
        let value = made?;
        let seconds = begun.elapsed().as_secs_f64() + spent_before(&folder);
        let mut outputs = BTreeMap::new();
        for name in value.save(&folder)? {
            let hash = files::hash_file(&folder.join(&name))?;
            outputs.insert(name, hash);
        }
        let finished =
            SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |elapsed| elapsed.as_secs());
        let warnings = observer.heard().split_off(before);
        let record = Record {
            stage: stage.to_owned(),
            inputs,
            asked: Some(alone),
            made_by,
            outputs,
            seconds,
            lacuna: self.version.clone(),
            finished,
            warnings,
        };
        files::write_json(&folder.join(RECORD), &record)?;
        Ok(self.kept(record, value, true))
    }

    /// The hash of a stage's inputs and of what makes it.
    pub(super) fn hash_of(&self, stage: &str, inputs: &impl Serialize) -> Result<String, Stop> {
        Ok(Asked::of(stage, inputs, &self.version)?.whole)
    }

    /// Whether a stage is finished for these inputs.
    pub fn has(&self, stage: &str, inputs: &impl Serialize) -> Result<bool, Stop> {
        let Asked { alone, whole, .. } = Asked::of(stage, inputs, &self.version)?;
        let inputs = self.looked_at(stage, &alone).unwrap_or(whole);
        let folder = self.stage_folder(stage);
        let aside = self.aside(stage, &inputs);
        Ok([folder, aside].iter().any(|f| matches!(finished(f, &inputs), Finished::Whole(_))))
    }

    /// Takes back the mark that a stage is finished, so that [`RunDirectory::keep`] goes on with it.
    pub fn reopen(&self, stage: &str) -> Result<(), Stop> {
        let path = self.stage_folder(stage).join(RECORD);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(files::cannot_write(&path, &error))
            }
            _ => Ok(()),
        }
    }

    fn kept<T>(&mut self, record: Record, value: T, fresh: bool) -> Kept<T> {
        let kept = Kept { value, hash: record.hash(), seconds: record.seconds, fresh };
        self.records.push(record);
        kept
    }

    pub(super) fn aside(&self, stage: &str, inputs: &str) -> PathBuf {
        self.root.join(".kept").join(format!("{stage}-{}", &inputs[..12]))
    }

    /// Makes the stage's folder the one for these inputs.
    fn bring_folder(&self, stage: &str, inputs: &str) -> Result<(), Stop> {
        let folder = self.stage_folder(stage);
        let marked = fs::read_to_string(folder.join(INPUTS)).unwrap_or_default();
        if marked.trim() == inputs {
            return Ok(());
        }
        if folder.exists() && !marked.trim().is_empty() {
            move_folder(&folder, &self.aside(stage, marked.trim()))?;
        }
        let aside = self.aside(stage, inputs);
        if aside.exists() {
            return move_folder(&aside, &folder);
        }
        files::write_atomic(&folder.join(INPUTS), format!("{inputs}\n").as_bytes())
    }
}

pub(super) fn move_folder(from: &Path, to: &Path) -> Result<(), Stop> {
    let result = (|| {
        if let Some(parent) = to.parent() {
            fs::create_dir_all(parent)?;
        }
        if to.exists() {
            fs::remove_dir_all(to)?;
        }
        fs::rename(from, to)
    })();
    result.map_err(|error| files::cannot_write(to, &error))
}

/// Whether a folder holds a finished stage.
pub(super) enum Finished {
    /// It does, and its files are as they were written.
    Whole(Record),
    /// It did: this file is missing or another one.
    Changed(String),
    /// It does not, or for other inputs.
    No,
}

pub(super) fn finished(folder: &Path, inputs: &str) -> Finished {
    let record = files::read_json::<Record>(&folder.join(RECORD)).ok();
    let Some(record) = record.filter(|record| record.inputs == inputs) else {
        return Finished::No;
    };
    let changed = |(name, hash): &(&String, &String)| {
        !files::hash_file(&folder.join(name)).is_ok_and(|found| &found == *hash)
    };
    match record.outputs.iter().find(changed) {
        Some((name, _)) => Finished::Changed(name.clone()),
        None => Finished::Whole(record),
    }
}

/// The time that interrupted attempts took, which a stage with checkpoints notes in `seconds`.
fn spent_before(folder: &Path) -> f64 {
    let text = fs::read_to_string(folder.join("seconds")).unwrap_or_default();
    text.trim().parse().unwrap_or(0.0)
}

#[cfg(test)]
mod tests;
