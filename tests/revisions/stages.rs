//! Results of each stage for a small study.

use std::collections::BTreeMap;

use lacuna_engine::pipeline;
use lacuna_run::stage::Depends;
use lacuna_run::{RunDirectory, Stage};

use super::{Bits, Made};
use crate::quick::{self, Watch};

/// Stages whose artifacts take minutes to compute: they are covered by tests of their own.
const UNTRIED: [Stage; 4] = [Stage::Gap, Stage::Show, Stage::Power, Stage::Coverage];

/// Hashes of the artifacts of a run of the small study, by stage: of files with results, without times.
pub fn all() -> BTreeMap<String, Made> {
    let folder = quick::simulated();
    let settings = [
        "design.runs=16",
        "surrogate.validation=4",
        "surrogate.degree=2",
        "sampler.steps=30",
        "validate.emulator_check=1",
        "quantity=[{ name = 'peak', use = 'maximum' }, { name = 'largest', use = 'expression', formula = 'max(peak_B, peak_C)' }]",
        "reliability=[{ name = 'limit', quantity = 'largest', above = 5e-4, use = 'subset_simulation' }]",
        "numerical_error.runs=3",
        "numerical_error.model.numerics.mesh=[10, 40]",
    ];
    let study = quick::load(&folder.path().join("study.toml"), &settings);
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    pipeline::run(&study, &mut run, &Watch::default()).unwrap_or_else(|stop| panic!("{stop}"));
    let mut found: BTreeMap<String, (u32, Bits)> = BTreeMap::new();
    for record in run.records() {
        let stage = of_folder(&record.stage);
        let revision = match stage.depends() {
            Depends::OnNothing => 1,
            Depends::OnRevisions(revision) | Depends::OnVersion(revision) => revision,
        };
        let name = stage.label().to_owned();
        let (_, bits) = found.entry(name).or_insert((revision, Bits::default()));
        let results = record.outputs.iter().filter(|(file, _)| !file.contains("seconds"));
        results.for_each(|(file, hash)| bits.text(&format!("{file} {hash}\n")));
    }
    let missing: Vec<Stage> = Stage::ALL
        .into_iter()
        .filter(|stage| !found.contains_key(stage.label()))
        // The report keeps no artifact that anything depends on.
        .filter(|stage| *stage != Stage::Report && !UNTRIED.contains(stage))
        .collect();
    assert!(missing.is_empty(), "the small study has no stage {missing:?}");
    let made = |(name, (revision, bits)): (String, (u32, Bits))| {
        (name, Made { revision, hash: bits.hash() })
    };
    found.into_iter().map(made).collect()
}

/// The stage of a folder: the one whose label is last in its name.
fn of_folder(folder: &str) -> Stage {
    let place = |stage: &Stage| folder.rfind(&format!("-{}", stage.label()));
    Stage::ALL.into_iter().max_by_key(place).unwrap()
}
