//! Folders for inputs that are read as files, and questions that several targets ask.

use std::fs;
use std::path::Path;

use lacuna::data::{Axis, Layout, Unit};
use lacuna::plugin::reader::ReadError;
use lacuna::run::Stop;
use tempfile::TempDir;

/// Longest input in bytes: more adds time and no structure.
pub const LONGEST: usize = 64 * 1024;

thread_local! {
    static FOLDER: TempDir = tempfile::tempdir().expect("a folder for inputs");
}

/// Looks at a folder of this thread.
pub fn in_folder<T>(look: impl FnOnce(&Path) -> T) -> T {
    FOLDER.with(|folder| look(folder.path()))
}

/// Looks at bytes as a file.
pub fn as_file<T>(name: &str, bytes: &[u8], look: impl FnOnce(&Path) -> T) -> T {
    in_folder(|folder| {
        let path = folder.join(name);
        fs::write(&path, bytes).expect("the input can be written");
        look(&path)
    })
}

/// A unit of the tests.
pub fn unit(text: &str) -> Unit {
    Unit::parse(text).expect("a unit")
}

/// A response over twenty times, as in the study that `lacuna new study` writes.
pub fn layout() -> Layout {
    let times = (1..=20).map(|i| f64::from(i) / 20.0).collect();
    Layout {
        name: "displacement".to_owned(),
        unit: unit("mm"),
        axes: vec![Axis::grid("time", times, unit("s"))],
    }
}

/// Asks that an error of a reader names the file and says something of it.
pub fn is_told(error: &ReadError, path: &Path) {
    for each in error.clone().into_each() {
        assert!(!each.message.trim().is_empty(), "an error without a message: {each:?}");
        assert!(!each.path.as_os_str().is_empty(), "an error without a file: {each:?}");
    }
    let folder = path.parent().unwrap_or(path);
    let text = error.to_string();
    assert!(text.contains(&folder.display().to_string()), "`{text}` does not name the file");
    assert!(text.len() < 1_000_000, "a message of {} bytes", text.len());
}

/// Asks that a stop says something.
pub fn says_why(stop: &Stop) {
    assert!(!stop.message.trim().is_empty(), "a stop without a reason");
}
