//! Reuse of finished stages of another run.

use std::fs;
use std::path::Path;

use lacuna::run::{Stop, files};

use crate::RunDirectory;

impl RunDirectory {
    /// Takes over the folders of stages from another run, unless this run already has a folder of the name: as hard
    /// links to the same files, or as copies. Each stage checks its inputs when it is reached.
    pub fn adopt(&self, other: &Path, wanted: impl Fn(&str) -> bool) -> Result<(), Stop> {
        let entries = fs::read_dir(other).map_err(|error| files::cannot_read(other, &error))?;
        for entry in entries.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let target = self.root().join(&name);
            if entry.path().is_dir() && wanted(&name) && !target.exists() {
                link(&entry.path(), &target)?;
            }
        }
        Ok(())
    }
}

/// Creates a folder with hard links to all files of another, and copies of the files that are appended to.
pub(super) fn link(from: &Path, to: &Path) -> Result<(), Stop> {
    fs::create_dir_all(to).map_err(|error| files::cannot_write(to, &error))?;
    let entries = fs::read_dir(from).map_err(|error| files::cannot_read(from, &error))?;
    for entry in entries.flatten() {
        let (path, target) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            link(&path, &target)?;
        } else if path.extension().is_some_and(|extension| extension == "jsonl")
            || fs::hard_link(&path, &target).is_err()
        {
            // A copy serves for another disk, or a file system without hard links.
            fs::copy(&path, &target).map_err(|error| files::cannot_write(&target, &error))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn wanted_folders_are_there_and_others_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let [from, to] = ["from", "to"].map(|name| folder.path().join(name));
        fs::create_dir_all(from.join("2-simulate/run1")).unwrap();
        fs::create_dir_all(from.join("5-calibrate")).unwrap();
        fs::write(from.join("2-simulate/run1/x.json"), "1").unwrap();
        let run = RunDirectory::open(&to).unwrap();
        run.adopt(&from, |name| name.starts_with('2')).unwrap();
        assert_eq!(fs::read_to_string(to.join("2-simulate/run1/x.json")).unwrap(), "1");
        assert!(!to.join("5-calibrate").exists());
    }
}
