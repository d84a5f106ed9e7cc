//! Search for programs.

use std::env;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::Command;

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

/// Lets a process that computes with large arrays keep the memory that it frees: under the C library of GNU each array above
/// some MB is otherwise asked of the system and returned to it, and its pages are cleared each time, which takes `NumPy` as long
/// as the sums themselves. Variables that are set already keep their values.
pub fn keep_freed_memory(command: &mut Command) {
    for name in ["MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"] {
        if env::var_os(name).is_none() {
            command.env(name, (1_u32 << 30).to_string());
        }
    }
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
