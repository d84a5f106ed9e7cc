//! The folders of stages in a run directory, for other processes: nothing is locked or written.

use std::fs;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use lacuna::run::files;

use crate::directory::{INPUTS, RECORD, Record, inputs_of};

/// Folder of a stage, as another process sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenStage {
    /// Name of the folder, such as `5-calibrate`.
    pub folder: String,
    /// Time at which the stage was begun with its inputs, in seconds since 1970 (UTC).
    pub begun: u64,
    /// Record of the finished stage; `None` while it is made, or if it was interrupted.
    pub record: Option<Record>,
}

/// Folders of stages in a run directory, in the order of their names; empty if it cannot be read.
pub fn stages(root: &Path) -> Vec<SeenStage> {
    let Ok(entries) = fs::read_dir(root) else { return Vec::new() };
    let one = |entry: fs::DirEntry| {
        let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
        if !name.starts_with(|c: char| c.is_ascii_digit()) {
            return None;
        }
        let written = fs::metadata(path.join(INPUTS)).and_then(|found| found.modified()).ok()?;
        let inputs = inputs_of(&path);
        let record = files::read_json::<Record>(&path.join(RECORD)).ok();
        let record = record.filter(|record| record.inputs == inputs);
        Some(SeenStage { folder: name, begun: seconds(written), record })
    };
    let mut found: Vec<SeenStage> = entries.flatten().filter_map(one).collect();
    found.sort_by(|a, b| a.folder.cmp(&b.folder));
    found
}

/// Seconds since 1970 (UTC).
fn seconds(time: SystemTime) -> u64 {
    time.duration_since(UNIX_EPOCH).map_or(0, |elapsed| elapsed.as_secs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_without_the_record_of_its_inputs_is_not_finished() {
        let folder = tempfile::tempdir().unwrap();
        let record = |inputs: &str| {
            format!(
                r#"{{"stage": "a", "inputs": "{inputs}", "outputs": {{}}, "seconds": 1.5, "lacuna": "0", "finished": 9}}"#
            )
        };
        for (name, inputs, of) in [
            ("1-a", "x", Some("x")),
            ("2-b", "y", Some("x")),
            ("3-c", "z", None),
            (".kept", "x", None),
        ] {
            let stage = folder.path().join(name);
            fs::create_dir(&stage).unwrap();
            fs::write(stage.join(INPUTS), format!("{inputs}\n")).unwrap();
            if let Some(of) = of {
                fs::write(stage.join(RECORD), record(of)).unwrap();
            }
        }
        fs::create_dir(folder.path().join("4-none")).unwrap();
        let seen = stages(folder.path());
        let seen: Vec<_> = seen.iter().map(|s| (s.folder.as_str(), s.record.is_some())).collect();
        assert_eq!(seen, [("1-a", true), ("2-b", false), ("3-c", false)]);
    }
}
