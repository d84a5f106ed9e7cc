//! Tests of the formats, with files of the real libraries and with text in their printed layout.
#![allow(clippy::unwrap_used)]

mod c_library;
mod exodus;
mod heartbeat;
mod hostile;
mod plugin;
mod synthetic;
mod write;

use std::path::PathBuf;

/// Path of a sample shipped with the project. All but `base.csv` were written by the SEACAS IOSS library (Exodus
/// 9.06, netCDF-C 4.9.0) from the signals of `base.csv`, ten gauges in microstrain.
pub(super) fn sample(name: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/samples")).join(name)
}

/// Path of a file of the reference collection, which is not part of the project.
pub(super) fn reference(name: &str) -> Option<PathBuf> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/reference/exodus_samples");
    let path = PathBuf::from(folder).join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: the reference file {name} is not here");
    None
}

/// The signals behind the samples: names, times and values in strain.
pub(super) fn base() -> (Vec<String>, Vec<f64>, Vec<Vec<f64>>) {
    let text = std::fs::read_to_string(sample("base.csv")).unwrap();
    let mut lines = text.lines();
    let names: Vec<String> =
        lines.next().unwrap().split(',').skip(1).take(10).map(str::to_owned).collect();
    let rows: Vec<Vec<f64>> =
        lines.map(|l| l.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    let times = rows.iter().map(|r| r[0]).collect();
    let values = (1..=10).map(|c| rows.iter().map(|r| r[c] * 1e-6).collect()).collect();
    (names, times, values)
}

/// Returns the largest difference between two lists of equal length.
pub(super) fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}
