//! Stages whose inputs grow: more of the same runs.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::adopt::link;
use super::directory::{INPUTS, move_folder};
use super::{RunDirectory, Stop, files};

impl RunDirectory {
    /// Lets a stage go on in a folder that was made for smaller inputs (fewer of the same runs), the first of `smaller` that
    /// there is: the folder stays where it is, since others may be writing there, and what was finished for the
    /// smaller inputs is kept beside it as links.
    pub fn go_on_from(
        &self,
        stage: &str,
        inputs: &impl Serialize,
        smaller: &[impl Serialize],
    ) -> Result<(), Stop> {
        let inputs = self.hash_of(stage, inputs)?;
        let folder = self.stage_folder(stage);
        let marked = fs::read_to_string(folder.join(INPUTS)).unwrap_or_default();
        let marked = marked.trim();
        if marked == inputs || self.aside(stage, &inputs).exists() {
            return Ok(());
        }
        for smaller in smaller {
            let smaller = self.hash_of(stage, smaller)?;
            let aside = self.aside(stage, &smaller);
            if marked == smaller {
                link_whole(&folder, &aside)?;
                return self.relabel(stage, &inputs);
            }
            if aside.exists() {
                if !marked.is_empty() {
                    move_folder(&folder, &self.aside(stage, marked))?;
                }
                link_whole(&aside, &folder)?;
                return self.relabel(stage, &inputs);
            }
        }
        Ok(())
    }

    /// Makes a stage's folder one of other inputs, which is not finished.
    fn relabel(&self, stage: &str, inputs: &str) -> Result<(), Stop> {
        self.reopen(stage)?;
        let path = self.stage_folder(stage).join(INPUTS);
        files::write_atomic(&path, format!("{inputs}\n").as_bytes())
    }
}

/// A folder of links that is there as a whole or not at all.
fn link_whole(from: &Path, to: &Path) -> Result<(), Stop> {
    if to.exists() {
        return Ok(());
    }
    let mut part = to.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    if part.exists() {
        fs::remove_dir_all(&part).map_err(|error| files::cannot_write(&part, &error))?;
    }
    link(from, &part)?;
    move_folder(&part, to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::{Artifact, Silent};

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
    fn a_stage_that_grows_goes_on_and_keeps_what_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let mut run = RunDirectory::open(folder.path()).unwrap();
        keep(&mut run, 1, 0.1);
        let log = folder.path().join("1-test/runs.jsonl");
        fs::write(&log, "first\n").unwrap();
        run.go_on_from("1-test", &12, &[11, 1]).unwrap();
        // It is not finished, and what was there is there.
        let grown = run.keep("1-test", &12, &Silent, |folder| {
            assert!(folder.join("number.json").exists());
            fs::write(&log, "first\nsecond\n").unwrap();
            Ok(Number(1.2))
        });
        assert_eq!(grown.unwrap().value, Number(1.2));
        run.go_on_from("1-test", &12, &[11, 1]).unwrap();
        assert_eq!(keep(&mut run, 12, 9.0), (1.2, false));
        assert_eq!(keep(&mut run, 1, 9.0), (0.1, false));
        assert_eq!(fs::read_to_string(&log).unwrap(), "first\n", "what is added to is a copy");
        // From the other side again, and on.
        run.go_on_from("1-test", &123, &[12]).unwrap();
        assert_eq!(fs::read_to_string(&log).unwrap(), "first\nsecond\n");
        assert_eq!(keep(&mut run, 123, 3.0), (3.0, true));
    }
}
