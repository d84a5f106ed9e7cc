//! Long tables of measurements: what a point takes of memory.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use crate::quick;

/// Number of points of each replicate.
const POINTS: usize = 100;

/// Writes a study of a straight line with this number of replicates.
fn study(folder: &Path, replicates: usize) {
    let study = "[study]\nname = \"line\"\ntitle = \"A line\"\nseed = 1\n\n[[parameter]]\nname = \"a\"\nprior = { uniform = [0, 1] }\n\n\
        [response]\nname = \"y\"\nunit = \"m\"\n\
        axes = { t = { first = 0.0, last = 99.0, count = 100, unit = \"s\" } }\n\n\
        [model]\nuse = \"equations\"\nwhere = { x = \"t / (1 {s})\" }\nobserve = \"a * x * (1 {m})\"\n\n\
        [measurements]\nuse = \"csv\"\npath = \"data.csv\"\n\n[design]\nuse = \"latin_hypercube\"\nruns = 20\n\n\
        [surrogate]\nuse = \"polynomial_chaos\"\n\n\
        [discrepancy]\nuse = \"gaussian\"\nvariance = { half_normal = 0.01 }\n\n\
        [sampler]\nuse = \"affine_invariant_ensemble\"\nwalkers = 10\nsteps = 10\n";
    fs::write(folder.join("study.toml"), study).unwrap();
    let mut table = String::from("replicate,t [s],y [m]\n");
    for i in 0..replicates * POINTS {
        let (replicate, t) = (i / POINTS, i % POINTS);
        writeln!(table, "{replicate},{t},{:.6}", 0.5 * t as f64 + (i as f64).sin()).unwrap();
    }
    fs::write(folder.join("data.csv"), table).unwrap();
}

/// Largest resident memory of `lacuna check` of such a study, in bytes.
fn memory(replicates: usize) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    study(folder.path(), replicates);
    let mut command = quick::command();
    command.args(["check", "study.toml"]).current_dir(folder.path());
    let mut process = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let status = format!("/proc/{}/status", process.id());
    let mut largest = 0.0_f64;
    let ended = loop {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let number = line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok());
        largest = largest.max(1024.0 * number.unwrap_or(0.0));
        if let Some(ended) = process.try_wait().unwrap() {
            break ended;
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    assert!(ended.success());
    largest
}

/// A table of 600,000 points is held in at most three times the eight bytes of a number for each.
#[test]
fn a_point_of_a_long_table_takes_three_numbers_of_memory() {
    let replicates = 6000;
    let of_a_point = (memory(replicates) - memory(10)) / (replicates * POINTS) as f64;
    assert!(of_a_point < 24.0, "{of_a_point} bytes a point");
}
