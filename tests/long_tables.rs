//! Long tables of measurements: what a point takes of memory.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use crate::{python, quick};

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

/// Runs a command and prints the largest resident memory that the kernel counted for it until its end, in KiB. Reading
/// `/proc` while it runs would miss what a process takes after the last reading.
const LARGEST: &str = r"
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
";

/// Largest resident memory of `lacuna check` of such a study, in bytes.
fn memory(python: &OsStr, replicates: usize) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    study(folder.path(), replicates);
    let lacuna = quick::command();
    let mut command = Command::new(python);
    command.arg("-c").arg(LARGEST).arg(lacuna.get_program()).args(["check", "study.toml"]);
    let output = command.current_dir(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    1024.0 * String::from_utf8(output.stdout).unwrap().trim().parse::<f64>().unwrap()
}

/// A table of 600,000 points is held in at most three times the eight bytes of a number for each.
#[test]
fn a_point_of_a_long_table_takes_three_numbers_of_memory() {
    let Some(python) = python::interpreter("its standard library") else { return };
    let replicates = 6000;
    let of_a_point =
        (memory(&python, replicates) - memory(&python, 10)) / (replicates * POINTS) as f64;
    assert!(of_a_point < 24.0, "{of_a_point} bytes a point");
}
