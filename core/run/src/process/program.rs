//! Search for programs.

use std::env;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

/// The file of a command's first word: a path relative to `directory`, or a name that is searched for in the
/// directories of `path` (those of the environment if `None`). Returns `None` if there is no such executable file.
pub fn find(program: &str, directory: &Path, path: Option<&OsStr>) -> Option<PathBuf> {
    let absolute = std::path::absolute(directory).unwrap_or_else(|_| directory.to_owned());
    if Path::new(program).components().count() > 1 {
        return Some(absolute.join(program)).filter(|file| can_run(file));
    }
    let folders = path.map(OsString::from).or_else(|| env::var_os("PATH"))?;
    env::split_paths(&folders)
        .map(|folder| absolute.join(folder).join(format!("{program}{}", env::consts::EXE_SUFFIX)))
        .find(|file| can_run(file))
}

/// The Python interpreter that a path means: a path relative to `directory`, a name that is searched for, or the directory
/// of a virtual environment. Returns `None` if there is no such executable file.
pub fn interpreter(path: &Path, directory: &Path) -> Option<PathBuf> {
    let folder = directory.join(path);
    let inside = if cfg!(windows) { "Scripts/python" } else { "bin/python" };
    let path = if folder.is_dir() { folder.join(inside) } else { path.to_owned() };
    find(path.to_str()?, directory, None)
}

#[cfg(unix)]
fn can_run(file: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt as _;
    file.metadata().is_ok_and(|data| data.is_file() && data.permissions().mode() & 0o111 != 0)
}

#[cfg(not(unix))]
fn can_run(file: &Path) -> bool {
    file.is_file()
}
