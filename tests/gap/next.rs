//! The next measurement of a coasting body, whose drag the slow runs do not tell: recommended, taken, and decisive. The truth
//! is the closed form of `dv/dt = -r - b v^2`.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use lacuna::math::random::{Stream, normal};
use lacuna::run::Silent;
use lacuna_engine::gap::next::Wanted;
use lacuna_engine::gap::result::GapResult;
use lacuna_engine::gap::search::VerdictKind;
use lacuna_engine::study::resolve::load_text;
use lacuna_run::RunDirectory;

const STUDY: &str = r#"
[study]
title = "a body coasts"
seed = 3

[[parameter]]
name = "rolling"
unit = "m/s2"
prior = { uniform = [0.0, 2.0] }

[[scenario]]
name = "slow"
values = { begin = { value = 3.0, unit = "m/s" } }

[[scenario]]
name = "fast"
values = { begin = { value = 12.0, unit = "m/s" } }
measured = false

[response]
name = "speed"
unit = "m/s"
axes = { t = { first = 0.05, last = 2.0, count = 40, unit = "s" } }

[model]
use = "equations"
state = { v = { start = "begin", unit = "m/s" } }
rate = { v = "-rolling" }
observe = "v"

[measurements]
use = "csv"
path = "data.csv"
noise = { sd = 0.003, memory = 0 }

[discrepancy]
use = "gaussian"
variance = { half_normal = 1.0 }

[sampler]
use = "affine_invariant_ensemble"
walkers = 16
steps = 300

[[gap.next]]
name = "slow_again"
scenarios = ["slow"]
replicates = 4
cost = 1.0

[[gap.next]]
name = "faster"
scenarios = ["fast"]
cost = 1.0

[[gap.next]]
name = "slow_end"
scenarios = ["slow"]
along = [[1.5, 2.0]]
replicates = 4
cost = 1.0

[gap.quantity]
scenarios = ["fast"]
along = [[1.95, 2.0]]
"#;

const ROLLING: f64 = 0.5;
const DRAG: f64 = 0.02;
const NOISE: f64 = 0.003;

fn speed(begin: f64, t: f64) -> f64 {
    let scale = (ROLLING / DRAG).sqrt();
    scale * ((begin / scale).atan() - (ROLLING * DRAG).sqrt() * t).tan()
}

/// Result of a search in measurements of these scenarios.
fn searched(folder: &Path, scenarios: &[(&str, f64)]) -> GapResult {
    let mut csv = String::from("scenario,t [s],speed [m/s]\n");
    for (k, (name, begin)) in scenarios.iter().enumerate() {
        let mut rng = Stream::root(11).at(k as u64).generator();
        for i in 1..=40 {
            let t = 0.05 * f64::from(i);
            let value = speed(*begin, t) + NOISE * normal(&mut rng);
            writeln!(csv, "{name},{t:.2},{value}").unwrap();
        }
    }
    fs::write(folder.join("data.csv"), csv).unwrap();
    let text =
        if scenarios.len() > 1 { STUDY.replace("measured = false\n", "") } else { STUDY.into() };
    let checked = load_text(&folder.join("study.toml"), &text, &[]);
    let complaints = checked.complaints();
    let study = checked.study.unwrap_or_else(|| panic!("{complaints}"));
    let mut run = RunDirectory::open(&folder.join(format!("run{}", scenarios.len()))).unwrap();
    let findings = lacuna_engine::pipeline::find_gap(&study, &mut run, &Silent).unwrap();
    findings.gap.unwrap().result
}

#[test]
fn the_recommended_measurement_makes_the_name_certain() {
    let folder = tempfile::tempdir().unwrap();
    let before = searched(folder.path(), &[("slow", 3.0)]);
    let next = before.insight.next.as_ref().unwrap();
    println!("{next:#?} {:#?}", before.verdict);
    assert_ne!(before.verdict.word, VerdictKind::Named, "{:?}", before.verdict);
    assert!(next.has(Wanted::Name), "{next:?}");
    assert_eq!(next.options[0].name, "faster", "{next:#?}");
    assert!(!next.options[1].equal_to_best, "{next:#?}");
    let after = searched(folder.path(), &[("slow", 3.0), ("fast", 12.0)]);
    println!("{:#?}", after.verdict);
    assert_eq!(after.verdict.effects[0].kind, "quadratic_friction", "{:#?}", after.verdict);
    let sure = |result: &GapResult| result.verdict.effects[0].probability;
    assert!(sure(&after) > sure(&before), "{:?} {:?}", before.verdict, after.verdict);
}
