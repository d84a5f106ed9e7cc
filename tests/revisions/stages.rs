//! What each stage makes of a small study.

use std::collections::BTreeMap;

use lacuna::run::RunDirectory;
use lacuna::run::made_by::{Depends, STAGES};
use lacuna::stage;

use super::{Bits, Made};
use crate::quick::{self, Watch};

/// Stages whose artifacts take minutes: they are compared by tests of their own.
const UNTRIED: [&str; 4] = ["gap", "show", "power", "coverage"];

/// The artifacts of a run of the small study, by stage: of files that hold results, not times.
pub fn all() -> BTreeMap<String, Made> {
    let folder = quick::simulated();
    let settings = [
        "design.runs=16",
        "surrogate.validation=4",
        "surrogate.degree=2",
        "sampler.steps=30",
        "validate.emulator_check=1",
        "numerical_error.runs=3",
        "numerical_error.model.numerics.mesh=[10, 40]",
    ];
    let study = quick::load(&folder.path().join("study.toml"), &settings);
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    stage::run(&study, &mut run, &Watch::default()).unwrap_or_else(|stop| panic!("{stop}"));
    let mut found: BTreeMap<String, (u32, Bits)> = BTreeMap::new();
    for record in run.records() {
        let known = |word: &str| STAGES.iter().find(|(name, _)| *name == word);
        let (name, depends) = record.stage.rsplit('-').find_map(known).unwrap();
        let revision = match depends {
            Depends::OnNothing => 1,
            Depends::OnRevisions(revision) | Depends::OnVersion(revision) => *revision,
        };
        let (_, bits) = found.entry((*name).to_owned()).or_insert((revision, Bits::default()));
        let results = record.outputs.iter().filter(|(file, _)| !file.contains("seconds"));
        results.for_each(|(file, hash)| bits.text(&format!("{file} {hash}\n")));
    }
    let missing: Vec<&str> = STAGES
        .iter()
        .map(|(name, _)| *name)
        .filter(|name| !found.contains_key(*name) && !UNTRIED.contains(name))
        .collect();
    assert!(missing.is_empty(), "the small study has no stage {missing:?}");
    let made = |(name, (revision, bits)): (String, (u32, Bits))| {
        (name, Made { revision, hash: bits.hash() })
    };
    found.into_iter().map(made).collect()
}
