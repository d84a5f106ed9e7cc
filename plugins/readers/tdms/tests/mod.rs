//! TDMS files: samples of npTDMS with what it reads in them, and segments that it does not write.
#![allow(clippy::unwrap_used)]

mod build;
mod hostile;
mod samples;
mod segments;

use std::path::{Path, PathBuf};

use super::file::File;
use crate::readers::records::store::Store as _;

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/samples").join(name)
}

/// A file with these bytes, and the folder that it is in as long as it is held.
fn written(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("record.tdms");
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

/// The name of a channel, and its numbers or what is said in their place.
type Said = (String, Result<Vec<f64>, String>);

fn all(path: &Path) -> Result<Vec<Said>, String> {
    let file = File::open(path).map_err(|e| e.to_string())?;
    let numbers = |name: &String| file.array(name).map(|a| a.values).map_err(|e| e.to_string());
    Ok(file.names().iter().map(|name| (name.clone(), numbers(name))).collect())
}
