//! Stages whose inputs grow: further runs of the same kind.

use std::fs;
use std::path::{Path, PathBuf};

use lacuna::run::{Stop, files};
use serde::Serialize;

use crate::RunDirectory;
use crate::adopt::link;
use crate::directory::{INPUTS, move_folder};
use crate::stage::Folder;

impl RunDirectory {
    /// Lets a stage continue in a folder that was made for smaller inputs (fewer of the same runs), the first of
    /// `smaller` that exists: the folder stays in place, since others may be writing there, and what was finished for
    /// the smaller inputs is kept beside it as links.
    pub fn go_on_from(
        &self,
        stage: &Folder,
        inputs: &impl Serialize,
        smaller: &[impl Serialize],
    ) -> Result<(), Stop> {
        if self.is_visited() {
            return Ok(());
        }
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

    /// Relabels a stage's folder as belonging to other inputs, and as not finished.
    fn relabel(&self, stage: &Folder, inputs: &str) -> Result<(), Stop> {
        self.reopen(stage)?;
        let path = self.stage_folder(stage).join(INPUTS);
        files::write_atomic(&path, format!("{inputs}\n").as_bytes())
    }
}

/// Creates a folder of links, either completely or not at all.
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
    use lacuna::run::Silent;

    use crate::Stage;
    use crate::testing::{Number, keep};

    #[test]
    fn a_stage_that_grows_goes_on_and_keeps_what_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let mut run = RunDirectory::open(folder.path()).unwrap();
        keep(&mut run, 1, 0.1);
        let log = folder.path().join("3-read/runs.jsonl");
        fs::write(&log, "first\n").unwrap();
        run.go_on_from(&Stage::Read.folder(), &12, &[11, 1]).unwrap();
        // The stage is not finished, and the earlier files are present.
        let grown = run.keep(&Stage::Read.folder(), &12, &Silent, |folder| {
            assert!(folder.join("number.json").exists());
            fs::write(&log, "first\nsecond\n").unwrap();
            Ok(Number(1.2))
        });
        assert_eq!(grown.unwrap().value, Number(1.2));
        run.go_on_from(&Stage::Read.folder(), &12, &[11, 1]).unwrap();
        assert_eq!(keep(&mut run, 12, 9.0), (1.2, false));
        assert_eq!(keep(&mut run, 1, 9.0), (0.1, false));
        assert_eq!(fs::read_to_string(&log).unwrap(), "first\n", "what is added to is a copy");
        // Return to the smaller inputs and continue from there.
        run.go_on_from(&Stage::Read.folder(), &123, &[12]).unwrap();
        assert_eq!(fs::read_to_string(&log).unwrap(), "first\nsecond\n");
        assert_eq!(keep(&mut run, 123, 3.0), (3.0, true));
    }
}
