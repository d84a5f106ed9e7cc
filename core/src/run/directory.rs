//! The run directory and its word [`RunDirectory::keep`]: cache, resume and provenance in one.

use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

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
    /// The hash of everything that went in.
    pub inputs: String,
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
    fn hash(&self) -> String {
        let lines: String =
            self.outputs.iter().map(|(file, hash)| format!("{hash} {file}\n")).collect();
        files::hash(lines.as_bytes())
    }
}

/// A folder that holds all artifacts of a study's run.
#[derive(Debug)]
pub struct RunDirectory {
    root: PathBuf,
    records: Vec<Record>,
    watched: Vec<Arc<Fault>>,
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

const RECORD: &str = "stage.json";
pub(super) const INPUTS: &str = "inputs.sha256";

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
        Ok(Self { root: root.to_owned(), records: Vec::new(), watched: Vec::new(), _lock: lock })
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

    /// The folder of a stage.
    pub fn stage_folder(&self, stage: &str) -> PathBuf {
        self.root.join(stage)
    }

    /// Returns the stage's saved result when the hash of its `inputs` is unchanged; else makes and saves it.
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
        let inputs = hash_of(stage, inputs)?;
        let folder = self.stage_folder(stage);
        self.bring_folder(stage, &inputs)?;
        match finished(&folder, &inputs) {
            Finished::Whole(record) => match T::load(&folder) {
                Ok(value) => {
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
            Finished::No => {}
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
        let lacuna = env!("CARGO_PKG_VERSION").to_owned();
        let warnings = observer.heard().split_off(before);
        let stage = stage.to_owned();
        let record = Record { stage, inputs, outputs, seconds, lacuna, finished, warnings };
        files::write_json(&folder.join(RECORD), &record)?;
        Ok(self.kept(record, value, true))
    }

    /// Whether a stage is finished for these inputs.
    pub fn has(&self, stage: &str, inputs: &impl Serialize) -> Result<bool, Stop> {
        let inputs = hash_of(stage, inputs)?;
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
enum Finished {
    /// It does, and its files are as they were written.
    Whole(Record),
    /// It did: this file is missing or another one.
    Changed(String),
    /// It does not, or for other inputs.
    No,
}

fn finished(folder: &Path, inputs: &str) -> Finished {
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

pub(super) fn hash_of(stage: &str, inputs: &impl Serialize) -> Result<String, Stop> {
    let text = serde_json::to_string(&(stage, inputs))
        .map_err(|error| Stop::new(format!("cannot hash the inputs of {stage}: {error}")))?;
    Ok(files::hash(text.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::Silent;

    #[derive(Debug, PartialEq)]
    struct Number(f64);

    impl Artifact for Number {
        fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
            files::write_json(&folder.join("number.json"), &self.0)?;
            Ok(vec!["number.json".to_owned()])
        }
        fn load(folder: &Path) -> Result<Self, Stop> {
            Ok(Self(files::read_json(&folder.join("number.json"))?))
        }
    }

    fn keep(run: &mut RunDirectory, input: u32, value: f64) -> (f64, bool) {
        let kept = run.keep("1-test", &input, &Silent, |_| Ok(Number(value))).unwrap();
        (kept.value.0, kept.fresh)
    }

    #[test]
    fn a_stage_is_made_once_for_each_input_and_never_lost() {
        let folder = tempfile::tempdir().unwrap();
        let mut run = RunDirectory::open(folder.path()).unwrap();
        assert_eq!(keep(&mut run, 1, 0.1), (0.1, true));
        assert_eq!(keep(&mut run, 1, 9.0), (0.1, false));
        assert_eq!(keep(&mut run, 2, 0.2), (0.2, true));
        assert_eq!(keep(&mut run, 1, 9.0), (0.1, false));
        assert_eq!(keep(&mut run, 2, 9.0), (0.2, false));
    }

    #[test]
    fn a_damaged_artifact_is_made_again() {
        let folder = tempfile::tempdir().unwrap();
        let mut run = RunDirectory::open(folder.path()).unwrap();
        keep(&mut run, 1, 0.1);
        fs::write(folder.path().join("1-test/number.json"), "0.3").unwrap();
        assert_eq!(keep(&mut run, 1, 0.2), (0.2, true));
    }

    #[test]
    fn an_interrupted_stage_finds_what_it_wrote() {
        let folder = tempfile::tempdir().unwrap();
        let mut run = RunDirectory::open(folder.path()).unwrap();
        let first = run.keep("1-test", &1, &Silent, |folder| {
            files::write_json(&folder.join("half.json"), &0.5)?;
            Err::<Number, _>(Stop::new("killed"))
        });
        assert_eq!(first.unwrap_err().message, "killed");
        let second = run.keep("1-test", &1, &Silent, |folder| {
            Ok(Number(files::read_json::<f64>(&folder.join("half.json"))? * 2.0))
        });
        assert_eq!(second.unwrap().value, Number(1.0));
    }

    #[test]
    fn two_processes_do_not_share_a_run() {
        let folder = tempfile::tempdir().unwrap();
        let _first = RunDirectory::open(folder.path()).unwrap();
        let second = RunDirectory::open(folder.path()).unwrap_err();
        assert!(second.message.starts_with("another process is working in"));
        let without_locks = std::io::Error::from(std::io::ErrorKind::Unsupported);
        assert!(!is_taken(&Err(TryLockError::Error(without_locks))));
    }
}
