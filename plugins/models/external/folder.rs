//! Folder in which a command runs.

use std::fs;
use std::path::{Component, Path, PathBuf};

use lacuna::plugin::model::{Call, EvalError};
use lacuna::run::files::in_words;
use tempfile::TempDir;

/// Folder of a run.
pub enum Folder {
    /// A folder kept by the study.
    Kept(PathBuf),
    /// A temporary folder for an evaluation of which nothing is kept.
    Passing(TempDir),
}

impl Folder {
    /// Creates an empty folder for a call; files of an earlier, interrupted run are removed.
    pub fn of(call: &Call<'_>) -> Result<Self, EvalError> {
        let Some(directory) = call.directory else {
            let folder = tempfile::Builder::new().prefix("lacuna-run-").tempdir();
            return folder.map(Self::Passing).map_err(|error| {
                EvalError::Fatal(format!("cannot make a folder for a run: {}", in_words(&error)))
            });
        };
        let failed = |error| cannot("make the folder", directory, &error);
        let folder = std::path::absolute(directory).map_err(failed)?;
        if folder.exists() {
            fs::remove_dir_all(&folder).map_err(failed)?;
        }
        fs::create_dir_all(&folder).map_err(failed)?;
        Ok(Self::Kept(folder))
    }

    /// Returns the absolute path.
    pub fn path(&self) -> &Path {
        match self {
            Self::Kept(path) => path,
            Self::Passing(folder) => folder.path(),
        }
    }

    /// Leaves the folder after the run; it is removed unless `keep` is true.
    pub fn leave(self, keep: bool) {
        if let (Self::Kept(path), false) = (&self, keep) {
            // A file held open by another process costs some space and no result.
            let _ = fs::remove_dir_all(path);
        }
    }
}

/// Returns the error for a failed file operation: no run can be made.
pub fn cannot(what: &str, path: &Path, error: &std::io::Error) -> EvalError {
    EvalError::Fatal(format!("cannot {what} {}: {}", path.display(), in_words(error)))
}

/// Returns true if a relative path stays inside the folder it starts from.
pub fn stays_inside(path: &Path) -> bool {
    let normal = |component| matches!(component, Component::Normal(_) | Component::CurDir);
    path.components().all(normal) && path.file_name().is_some()
}

/// Copies a file, or a folder with its contents.
pub fn copy(from: &Path, to: &Path) -> std::io::Result<()> {
    if !from.is_dir() {
        return fs::copy(from, to).map(|_| ());
    }
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        copy(&entry.path(), &to.join(entry.file_name()))?;
    }
    Ok(())
}

/// Makes a symbolic link, or a copy on systems without links.
pub fn link(from: &Path, to: &Path) -> std::io::Result<()> {
    #[cfg(unix)]
    return std::os::unix::fs::symlink(from, to);
    #[cfg(not(unix))]
    copy(from, to)
}
