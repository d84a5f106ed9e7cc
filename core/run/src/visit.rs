//! A run directory as a process sees it that computes a part of a stage for another process, which works in the directory
//! meanwhile.

use std::path::Path;

use lacuna::run::{Stop, files};

use crate::directory::{Finished, finished};
use crate::{Artifact, Folder, Kept, RunDirectory};

impl RunDirectory {
    /// Opens the folder beside the process that works in it: nothing is locked or written, and only finished results are there.
    ///
    /// # Errors
    /// If there is no such folder.
    pub fn visit(root: &Path) -> Result<Self, Stop> {
        std::fs::read_dir(root).map_err(|error| files::cannot_read(root, &error))?;
        Ok(Self::with(root, None))
    }

    /// True if the folder was opened by [`Self::visit`]: what is missing or damaged in it is made by another process.
    pub fn is_visited(&self) -> bool {
        self.lock.is_none()
    }

    /// The result of a stage in a folder that is only visited.
    pub(super) fn visited<T: Artifact>(
        &mut self,
        stage: &Folder,
        inputs: &str,
    ) -> Result<Kept<T>, Stop> {
        let folder = self.stage_folder(stage);
        let missing = |what: &str| {
            Stop::new(format!("{what} in {}, as this process reads it", self.root().display())).help(
                "run the command again that asked for the cases; if nothing has changed, this process sees other files than \
                 that one: of the study, of its data, or of the run directory",
            )
        };
        match finished(&folder, inputs) {
            Finished::Whole(record) => {
                let value = T::load(&folder)?;
                Ok(self.kept(record, value, false))
            }
            Finished::Changed(file) => Err(missing(&format!("`{stage}/{file}` has changed"))),
            Finished::No => Err(missing(&format!("`{stage}` is not finished"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::run::Silent;

    use crate::Stage;
    use crate::testing::{Number, keep};

    #[test]
    fn a_visitor_reads_what_is_finished_and_changes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let mut run = RunDirectory::open(folder.path()).unwrap();
        keep(&mut run, 1, 0.1);
        // The first process still holds its lock.
        let mut visitor = RunDirectory::visit(folder.path()).unwrap();
        assert_eq!(keep(&mut visitor, 1, 9.0), (0.1, false));
        let stage = Stage::Read.folder();
        visitor.go_on_from(&stage, &12, &[1]).unwrap();
        let asked: Result<Kept<Number>, Stop> =
            visitor.keep(&stage, &2, &Silent, |_| unreachable!("nothing is made"));
        let error = asked.unwrap_err().to_string();
        assert!(error.contains("`3-read` is not finished"), "{error}");
        std::fs::write(folder.path().join("3-read/number.json"), "7").unwrap();
        let asked: Result<Kept<Number>, Stop> =
            visitor.keep(&stage, &1, &Silent, |_| unreachable!("nothing is made"));
        let error = asked.unwrap_err().to_string();
        assert!(error.contains("`3-read/number.json` has changed"), "{error}");
        drop(visitor);
        assert!(!folder.path().join(".kept").exists());
        assert!(RunDirectory::visit(&folder.path().join("none")).is_err());
    }
}
