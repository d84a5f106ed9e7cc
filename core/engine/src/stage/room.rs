//! Room on the disk for a run that begins.

use std::path::Path;

use lacuna::run::Stop;

use crate::study::Study;
use crate::study::sizes::fits_on_disk;

/// Refuses a study that writes more than the disk of its new run directory has room for. A run that goes on has written
/// some of it already, and is not refused.
pub fn check(study: &Study, root: &Path) -> Result<(), Stop> {
    if root.join("resolved.toml").exists() {
        return Ok(());
    }
    free(root).map_or(Ok(()), |free| fits_on_disk(study, free)).map_err(|text| {
        let text = format!("{}: {text}", root.display());
        Stop::new(text)
            .help("choose a folder on another disk with `--out DIR`, or make the study smaller")
    })
}

/// Free space of the disk with this folder, in bytes; `None` where the system does not say.
#[cfg(unix)]
fn free(folder: &Path) -> Option<f64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail as f64 * disk.f_frsize as f64)
}

#[cfg(not(unix))]
fn free(_: &Path) -> Option<f64> {
    None
}
