//! Follows the README of `examples/campaign` in a folder outside the project: a newcomer's way to a cluster.

use std::fs;
use std::path::Path;

use super::queue;
use crate::commands::there_is_python;
use crate::quick;
use crate::readme::Walk;
use crate::slurm::{Kind, started};

const FOLDER: &str = "examples/campaign";

/// True values of `truth.deck`, repeated in the references of the study.
const TRUTH: [(&str, f64); 3] = [("conductivity", 29.0), ("emissivity", 0.75), ("film", 14.0)];

/// Checks that the posterior contains the truth within its uncertainty, which is small compared with the priors.
fn finds_its_truth(out: &Path, runs: usize) {
    let summary = quick::summary(out);
    assert_eq!(summary["converged"], true, "{}", summary["verdict"]);
    assert_eq!(summary["runs"]["used"], runs);
    for ((name, truth), prior) in TRUTH.into_iter().zip([20.0, 0.45, 25.0]) {
        let [mean, sd] = ["mean", "sd"].map(|key| summary["parameters"][name][key].as_f64());
        let (mean, sd) = (mean.unwrap(), sd.unwrap());
        assert!((mean - truth).abs() < 3.0 * sd && sd < 0.05 * prior, "{name}: {mean} ± {sd}");
    }
}

#[test]
fn the_campaign_goes_as_its_readme_says() {
    if !there_is_python() {
        return;
    }
    let mut walk = Walk::begin(&[FOLDER], FOLDER);
    walk.follow("On the laptop");
    walk.follow("All runs, in processes");
    walk.follow("Some have failed");
    let mended = quick::results(&walk.path("runs/billet"));
    finds_its_truth(&walk.path("runs/billet"), 40);
    walk.follow("More runs");
    finds_its_truth(&walk.path("runs/billet"), 50);
    walk.follow("Runs made by hand");
    finds_its_truth(&walk.path("runs/billet"), 52);
    // The place of the runs, and whether they succeeded at once or after a repair, changes nothing.
    walk.give("lacuna run study.toml --out runs/threads", 0);
    assert_eq!(quick::results(&walk.path("runs/threads")), mended);
    if let Some(slurm) = started(Kind::Plain) {
        walk.variables.push(("SLURM_CONF", slurm.conf().into()));
        walk.follow("On a cluster with Slurm");
        assert_eq!(quick::results(&walk.path("runs/slurm")), mended);
    }
    if let Some(server) = queue::started() {
        walk.programs.insert(0, server.folder().to_owned());
        walk.variables.push(("HQ_SERVER_DIR", server.folder().into()));
        walk.follow("On a cluster with HyperQueue");
        assert_eq!(quick::results(&walk.path("runs/hyperqueue")), mended);
    }
}

/// The shipped data and the runs made by hand are the output of the programs beside them.
#[test]
fn its_files_are_those_of_its_programs() {
    if !there_is_python() {
        return;
    }
    let mut walk = Walk::begin(&[FOLDER], FOLDER);
    let data = fs::read_to_string(walk.path("measured.csv")).unwrap();
    assert_eq!(walk.give("python3 measure.py", 0), data);
    for run in ["first", "second"] {
        let file = walk.path(&format!("hand/{run}/temperature.csv"));
        let made = fs::read_to_string(&file).unwrap();
        walk.give(&format!("cd hand/{run}; python3 ../../billet.py billet.deck"), 0);
        assert_eq!(fs::read_to_string(&file).unwrap(), made, "{run}");
    }
}

/// A study for a cluster is the one for the laptop plus one section.
#[test]
fn what_a_cluster_needs_is_one_section() {
    for name in ["processes", "slurm", "hyperqueue"] {
        let path = quick::root().join(FOLDER).join(name).with_extension("toml");
        let study: toml::Table = fs::read_to_string(path).unwrap().parse().unwrap();
        assert!(study.len() == 2 && study["executor"].is_table(), "{name}");
        assert_eq!(study["extends"].as_str(), Some("study.toml"), "{name}");
    }
}
