//! A companion: linear equations of two masses beside a table of runs, whose simulator also has a spring that hardens. The
//! runs and the measurements come from the generator's own integration; drag is hidden in the measurements.

use std::fmt::Write as _;
use std::fs;

use generator::chain::Chain;
use generator::noise::Source;
use lacuna::run::Silent;
use lacuna_engine::gap::result::GapResult;
use lacuna_engine::gap::search::VerdictKind;
use lacuna_engine::gap::stage::study_file;
use lacuna_engine::study::resolve;
use lacuna_run::RunDirectory;
use tempfile::TempDir;

use super::inside::loaded;

const STUDY: &str = r#"
[study]
title = "two masses"
seed = 11

[[parameter]]
name = "k1"
prior = { uniform = [3.2, 4.8] }

[[parameter]]
name = "k2"
prior = { uniform = [1.6, 2.4] }

[[parameter]]
name = "c"
prior = { uniform = [0.3, 0.5] }

[response]
name = "y"
axes = { sensor = ["x1", "x2", "v1"], time = { first = 0.0, last = 9.9, count = 100, unit = "1" } }

[simulations]
use = "csv"
parameters = "runs.csv"
responses = "responses.csv"

[measurements]
use = "csv"
path = "data.csv"

[surrogate]
use = "polynomial_chaos"
degree = { max = 6 }

[discrepancy]
use = "gaussian"
variance = { half_normal = 0.01 }

[sampler]
use = "affine_invariant_ensemble"
walkers = 16
steps = 100

[gap]
simulations = 99

[gap.companion]
use = "equations"
state = { x1 = 0.0, x2 = 0.0, v1 = 0.0, v2 = 0.0 }
observe = { x1 = "x1", x2 = "x2", v1 = "v1" }
fixed = FIXED

[gap.companion.rate]
x1 = "v1"
x2 = "v2"
v1 = "gain * 4 * exp(-((time - 1) / 0.35)^2) - k1 * x1 - c * v1 + k2 * (x2 - x1)"
v2 = "-k2 * (x2 - x1) - c * v2"
"#;

const CONSTANT: &str = r#"
[[gap.companion.parameter]]
name = "gain"
prior = { log_uniform = [0.2, 5.0] }
"#;

/// The stiffness that grows with the deflection: the simulator has it, the companion does not.
const HARDENING: f64 = 0.1;
const DRAG: f64 = 0.25;
const TRUTH: [f64; 4] = [4.1, 1.95, 0.41, 1.0];
const RUNS: usize = 80;
const REPLICATES: usize = 8;

/// The curves of `x1`, `x2` and `v1` at 100 times.
fn curves(parameters: [f64; 4], drag: f64) -> Vec<Vec<f64>> {
    let chain = Chain { cubic: HARDENING, drag, ..Chain::plain(parameters) };
    generator::sampled(&chain.curves(0)).into_iter().take(3).collect()
}

fn rows(csv: &mut String, first: &str, curves: &[Vec<f64>]) {
    for (sensor, curve) in ["x1", "x2", "v1"].iter().zip(curves) {
        for (i, y) in curve.iter().enumerate() {
            writeln!(csv, "{first},{sensor},{},{y}", 0.1 * i as f64).unwrap();
        }
    }
}

/// The folder of a study with a table of runs and measurements in which drag is hidden.
fn folder(drag: f64) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Source::new(3);
    let mut runs = "run,k1,k2,c\n".to_owned();
    let mut responses = "run,sensor,time,y\n".to_owned();
    for run in 0..RUNS {
        let [k1, k2, c] =
            [[3.2, 4.8], [1.6, 2.4], [0.3, 0.5]].map(|[low, high]| random.uniform(low, high));
        writeln!(runs, "{run},{k1},{k2},{c}").unwrap();
        rows(&mut responses, &run.to_string(), &curves([k1, k2, c, 1.0], 0.0));
    }
    let truth = curves(TRUTH, drag);
    let mut data = "replicate,sensor,time,y\n".to_owned();
    for replicate in 0..REPLICATES {
        let noisy: Vec<Vec<f64>> = truth
            .iter()
            .map(|curve| curve.iter().map(|y| y + 0.02 * random.normal()).collect())
            .collect();
        rows(&mut data, &replicate.to_string(), &noisy);
    }
    for (name, text) in [("runs.csv", runs), ("responses.csv", responses), ("data.csv", data)] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

fn searched(folder: &TempDir, text: &str) -> GapResult {
    let study = loaded(folder, text);
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    let findings = lacuna_engine::pipeline::find_gap(&study, &mut run, &Silent).unwrap();
    findings.gap.unwrap().result
}

/// Drag is named although the companion lacks the hardening spring; its constant is found from the runs; the study that is
/// written has the drag, and its response is that of the emulator with the companion's change.
#[test]
fn a_companion_names_the_drag_inside_a_table_of_runs() {
    let folder = folder(DRAG);
    let text = STUDY.replace("FIXED", "{}") + CONSTANT;
    let result = searched(&folder, &text);
    let companion = result.companion.as_ref().unwrap();
    assert!(companion.admitted && companion.error > 0.005, "{companion:?}");
    assert!((companion.constants[0] - 1.0).abs() < 0.05, "{companion:?}");
    let kinds: Vec<&str> = result.additions.iter().map(|a| a.kind.as_str()).collect();
    assert!(
        matches!(result.verdict.word, VerdictKind::Named | VerdictKind::Approximate),
        "{:?}",
        result.verdict
    );
    assert_eq!(kinds, ["quadratic_friction"], "{:?}", result.verdict);
    let size = &result.additions[0].unknowns[0];
    assert!((size.value - DRAG).abs() < 4.0 * size.sd && size.sd < 0.3 * DRAG, "{size:?}");
    let proof = &result.held_out[0].proof.all;
    assert!(proof.closed > 0.8 && proof.lower > 0.0, "{proof:?}");

    let path = folder.path().join("study.toml");
    fs::write(&path, &text).unwrap();
    let study = loaded(&folder, &text);
    let written = study_file::write(&study, &path, None, &result).unwrap();
    let checked = resolve::load(&written, &[]);
    let complaints = checked.complaints();
    let with = checked.study.unwrap_or_else(|| panic!("{complaints}"));
    let added = &with.gap.companion.as_ref().unwrap().keys;
    assert_eq!(added.add, ["quadratic_friction"]);
    assert!((added.constants["gain"] - companion.constants[0]).abs() < 1e-12, "{added:?}");
    lacuna_engine::gap::inside::companion::build_added(&with).unwrap();
    let placed = with.placed_effects();
    let nothing = vec![0.0; 300];
    let change = |size: f64| placed[0].apply(&nothing, &[size], &TRUTH[..3]);
    let (model, truth) = (curves(TRUTH, 0.0).concat(), curves(TRUTH, DRAG).concat());
    // The companion's change is that of the generator up to what hardening makes of it: a tenth of it.
    let square = |of: &dyn Fn(usize) -> f64| (0..300).map(|i| of(i).powi(2)).sum::<f64>();
    let own = change(DRAG);
    let error = square(&|i| own[i] - (truth[i] - model[i])) / square(&|i| truth[i] - model[i]);
    assert!(error.sqrt() < 0.1, "{error}");
    assert!(change(0.0).iter().all(|y| *y == 0.0));
}

/// A companion with a wrong constant that nothing identifies is not used, and the verdict says why.
#[test]
fn a_companion_that_does_not_answer_as_the_runs_is_not_used() {
    let folder = folder(DRAG);
    let result = searched(&folder, &STUDY.replace("FIXED", "{ gain = 0.5 }"));
    let companion = result.companion.as_ref().unwrap();
    assert!(!companion.admitted && companion.error > 0.4, "{companion:?}");
    assert!(result.additions.iter().all(|addition| !addition.is_in_companion()));
    let says = |words: &str| result.verdict.reasons.iter().any(|reason| reason.contains(words));
    assert!(says("the companion is not used: its error on"), "{:?}", result.verdict.reasons);
}
