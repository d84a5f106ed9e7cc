//! The run directory and its central operation [`RunDirectory::keep`]: cache, resume and provenance in one.

use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use lacuna::run::{Fault, Observer, Stop, files};
use serde::{Deserialize, Serialize};

use crate::made_by::{Asked, MadeBy};
use crate::stage::Folder;

/// Result of a stage that can be stored in files.
pub trait Artifact: Sized {
    /// Writes the result into the stage's folder and returns the names of the files that contain it.
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop>;

    /// Reads the result from the stage's folder.
    fn load(folder: &Path) -> Result<Self, Stop>;
}

/// Result of a finished stage.
#[derive(Debug, Clone)]
pub struct Kept<T> {
    /// The result itself.
    pub value: T,
    /// Hash of the files that contain it, for the stages that depend on it.
    pub hash: String,
    /// Duration of the stage when the result was made, in seconds.
    pub seconds: f64,
    /// True if the result was made by this call, false if it was reused.
    pub fresh: bool,
}

/// Record of a finished stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Name of the stage's folder.
    pub stage: String,
    /// Hash of all inputs and of the code that made the result.
    pub inputs: String,
    /// Hash of the inputs alone; equal to `inputs` if the result does not depend on code.
    #[serde(default)]
    pub asked: Option<String>,
    /// Versions of the code that made the result, as far as it depends on them.
    #[serde(default)]
    pub made_by: MadeBy,
    /// SHA-256 of each output file.
    pub outputs: BTreeMap<String, String>,
    /// Duration of the stage, in seconds.
    pub seconds: f64,
    /// Version of Lacuna that made the result.
    pub lacuna: String,
    /// Time of completion, in seconds since 1970 (UTC).
    pub finished: u64,
    /// Warnings that were given while the result was made.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

impl Record {
    /// Returns true if the result was made from inputs with this hash, by whatever code. A record from before code was
    /// recorded has only that hash.
    pub(super) fn is_of(&self, alone: &str) -> bool {
        self.asked.as_ref().unwrap_or(&self.inputs) == alone
    }

    fn hash(&self) -> String {
        let lines: String =
            self.outputs.iter().map(|(file, hash)| format!("{hash} {file}\n")).collect();
        files::hash(lines.as_bytes())
    }
}

/// Folder with all artifacts of a study's run.
#[derive(Debug)]
pub struct RunDirectory {
    pub(super) root: PathBuf,
    records: Vec<Record>,
    watched: Vec<Arc<Fault>>,
    pub(super) version: String,
    /// True if a stage was repeated because another version had made its result.
    pub(super) remade: bool,
    /// True if results are reused whatever code made them.
    pub(super) looking: bool,
    /// True if finished results are also reused whatever their inputs were.
    pub(super) as_recorded: bool,
    /// Hashes of the files of plugins that the study loads.
    pub(super) libraries: Vec<String>,
    /// Lock against other processes; `None` if the folder is only visited.
    pub(super) lock: Option<File>,
}

/// Takes the lock; waits briefly for a process that is about to release it.
fn locked(lock: &File) -> bool {
    (0..20).any(|attempt| {
        if attempt > 0 {
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        !is_taken(&lock.try_lock())
    })
}

/// Returns true if another process holds the lock. A file system without locks, such as Lustre mounted without `flock`,
/// cannot tell, and that is no reason to refuse work there.
fn is_taken(tried: &Result<(), TryLockError>) -> bool {
    matches!(tried, Err(TryLockError::WouldBlock))
}

pub(crate) const RECORD: &str = "stage.json";
pub(crate) const INPUTS: &str = "inputs.sha256";

/// Hash for which the folder of a stage was created: of the stage's inputs and of the code; empty if there is none.
pub fn inputs_of(folder: &Path) -> String {
    fs::read_to_string(folder.join(INPUTS)).unwrap_or_default().trim().to_owned()
}

impl RunDirectory {
    /// Opens or creates the folder and locks it against other processes.
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
        Ok(Self::with(root, Some(lock)))
    }

    pub(super) fn with(root: &Path, lock: Option<File>) -> Self {
        Self {
            root: root.to_owned(),
            records: Vec::new(),
            watched: Vec::new(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            remade: false,
            looking: false,
            as_recorded: false,
            libraries: Vec::new(),
            lock,
        }
    }

    /// Returns true if a process is working in the folder.
    ///
    /// The folder may be read-only. Several processes may ask at a time: none of them is taken for one that works.
    pub fn is_busy(root: &Path) -> bool {
        let lock = File::open(root.join(".lock"));
        lock.is_ok_and(|lock| is_taken(&lock.try_lock_shared()))
    }

    /// Path of the folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Records of the stages that were reused or made, in order.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// Registers faults: the result of a stage during which one of them occurs is not kept.
    pub fn watch(&mut self, faults: Vec<Arc<Fault>>) {
        self.watched = faults;
    }

    /// The registered faults.
    pub fn watched(&self) -> &[Arc<Fault>] {
        &self.watched
    }

    /// Accepts finished results whatever version made them, because inspecting a finished run is no reason to repeat
    /// it.
    pub fn look(&mut self) {
        self.looking = true;
    }

    /// Like [`Self::look`], and takes finished results as those of this study: a file of plugins is gone that would have to
    /// say what they were made from.
    pub fn look_as_recorded(&mut self) {
        self.look();
        self.as_recorded = true;
    }

    /// Registers the files of plugins that the study loads, by their hashes.
    pub fn uses(&mut self, libraries: impl IntoIterator<Item = String>) {
        self.libraries = libraries.into_iter().collect();
    }

    /// Acts as another version of the program, for tests of what that changes.
    #[doc(hidden)]
    pub fn pretend(&mut self, version: &str) {
        version.clone_into(&mut self.version);
    }

    /// Path of a stage's folder.
    pub fn stage_folder(&self, stage: &Folder) -> PathBuf {
        self.root.join(stage.name())
    }

    /// Returns the stage's saved result if the hash of its `inputs` and of the [code](MadeBy) is unchanged; otherwise
    /// makes and saves it. The observer is told if another version made the result: what is reused, and what is
    /// repeated and why.
    ///
    /// `make` is given the stage's folder. Files from an earlier, interrupted attempt with the same inputs are still
    /// there, so that `make` can continue. A folder made from other inputs is moved aside, not deleted, and restored
    /// when the study returns to those inputs.
    pub fn keep<T: Artifact>(
        &mut self,
        stage: &Folder,
        inputs: &impl Serialize,
        observer: &dyn Observer,
        make: impl FnOnce(&Path) -> Result<T, Stop>,
    ) -> Result<Kept<T>, Stop> {
        let Asked { alone, whole: inputs, made_by } =
            Asked::of(stage, inputs, &self.version, &self.libraries)?;
        let folder = self.stage_folder(stage);
        let inputs = self.looked_at(stage, &alone).unwrap_or(inputs);
        if self.is_visited() {
            return self.visited(stage, &inputs);
        }
        let before = self.made_otherwise(stage, &alone, &inputs, &made_by);
        self.bring_folder(stage, &inputs)?;
        match finished(&folder, &inputs) {
            Finished::Whole(record) => match T::load(&folder) {
                Ok(value) => {
                    if record.lacuna != self.version {
                        let made = &record.lacuna;
                        observer.note(&format!("`{stage}` is reused as made by lacuna {made}"));
                    }
                    record.warnings.iter().for_each(|text| observer.recall(text));
                    return Ok(self.kept(record, value, false));
                }
                Err(_) => observer.remark(&format!(
                    "the files in {} cannot be read; the stage is repeated",
                    folder.display()
                )),
            },
            Finished::Changed(file) => observer.remark(&format!(
                "{} is missing or has changed; the stage is repeated",
                folder.join(file).display()
            )),
            Finished::No => {
                if let Some(why) = before {
                    self.remade = true;
                    observer.note(&format!("`{stage}` is repeated: {why}"));
                }
            }
        }
        let begun = Instant::now();
        let before = observer.heard().len();
        let made = make(&folder);
        // The first fault explains more than the errors that followed from it.
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
            stage: stage.to_string(),
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

    /// Hash of a stage's inputs and of the code that makes its result.
    pub fn hash_of(&self, stage: &Folder, inputs: &impl Serialize) -> Result<String, Stop> {
        Ok(Asked::of(stage, inputs, &self.version, &self.libraries)?.whole)
    }

    /// Returns true if a stage is finished for these inputs.
    pub fn has(&self, stage: &Folder, inputs: &impl Serialize) -> Result<bool, Stop> {
        let Asked { alone, whole, .. } = Asked::of(stage, inputs, &self.version, &self.libraries)?;
        let inputs = self.looked_at(stage, &alone).unwrap_or(whole);
        let folder = self.stage_folder(stage);
        let aside = self.aside(stage, &inputs);
        Ok([folder, aside].iter().any(|f| matches!(finished(f, &inputs), Finished::Whole(_))))
    }

    /// Removes the mark that a stage is finished, so that [`RunDirectory::keep`] continues it.
    pub fn reopen(&self, stage: &Folder) -> Result<(), Stop> {
        let path = self.stage_folder(stage).join(RECORD);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(files::cannot_write(&path, &error))
            }
            _ => Ok(()),
        }
    }

    pub(super) fn kept<T>(&mut self, record: Record, value: T, fresh: bool) -> Kept<T> {
        let kept = Kept { value, hash: record.hash(), seconds: record.seconds, fresh };
        self.records.push(record);
        kept
    }

    /// Place of a stage's folder that was made for these inputs, while it stands aside. A mark that is no hash, such as that of
    /// a damaged file, is hashed: it must neither be too short nor lead out of the directory.
    pub(super) fn aside(&self, stage: &Folder, inputs: &str) -> PathBuf {
        let is_hash = inputs.len() == 64 && inputs.bytes().all(|byte| byte.is_ascii_hexdigit());
        let hash = if is_hash { inputs.to_owned() } else { files::hash(inputs.as_bytes()) };
        self.root.join(".kept").join(format!("{stage}-{}", &hash[..12]))
    }

    /// Makes the stage's folder the one for these inputs, moving another aside.
    fn bring_folder(&self, stage: &Folder, inputs: &str) -> Result<(), Stop> {
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

/// State of a stage's folder.
pub(super) enum Finished {
    /// Finished, with its files as they were written.
    Whole(Record),
    /// Finished, but this file is missing or has changed.
    Changed(String),
    /// Not finished, or made for other inputs.
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

/// Time spent in interrupted attempts, in seconds; a stage with checkpoints records it in the file `seconds`.
fn spent_before(folder: &Path) -> f64 {
    let text = fs::read_to_string(folder.join("seconds")).unwrap_or_default();
    text.trim().parse().unwrap_or(0.0)
}

#[cfg(test)]
mod tests;
