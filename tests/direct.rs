//! A study whose model is called directly, with replicates: what the error of their mean costs in runs of the model.

use std::fs;
use std::path::Path;

use lacuna::plugin::Forward;
use lacuna::plugin::forward::Wanted;
use lacuna_engine::stage::direct::ModelMap;
use lacuna_engine::study::resolve::load_text;
use lacuna_linalg::Matrix;

use crate::quick;

const STUDY: &str = r#"
[study]
name = "direct"
title = "A line through the origin"
seed = 3

[[parameter]]
name = "slope"
prior = { uniform = [0.0, 2.0] }

[response]
name = "y"
axes = { time = { first = 1, last = 8, count = 8, unit = "s" } }

[model]
use = "python"
file = "line.py"
function = "line"

[measurements]
use = "csv"
path = "y.csv"

[discrepancy]
use = "gaussian"
variance = { known = 0.01 }

[sampler]
use = "affine_invariant_ensemble"
walkers = 8
steps = 60

[validate]
rerun_model = false
"#;

/// The model notes each of its calls in a file.
const MODEL: &str = r#"
import pathlib


def line(slope):
    with (pathlib.Path(__file__).parent / "calls").open("a") as calls:
        calls.write("x")
    return [slope * time for time in range(1, 9)]
"#;

fn calls(folder: &Path) -> u64 {
    fs::metadata(folder.join("calls")).unwrap().len()
}

/// The least-squares best fit is `sum t y / sum t^2`; it is kept, so that the study is run again without a call of the model.
#[test]
fn the_best_fit_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("study.toml"), STUDY).unwrap();
    fs::write(folder.path().join("line.py"), MODEL).unwrap();
    let mut table = "replicate,time [s],y\n".to_owned();
    let (mut product, mut squares) = (0.0, 0.0);
    for (replicate, gain) in [0.9, 1.0, 1.15].into_iter().enumerate() {
        for time in 1..=8 {
            let (t, wobble) = (f64::from(time), 0.1 * f64::from((time * 7 + 3) % 5 - 2));
            let y = gain * t + wobble;
            table.push_str(&format!("{replicate},{t},{y}\n"));
            product += t * y;
            squares += t * t;
        }
    }
    fs::write(folder.path().join("y.csv"), table).unwrap();
    let (study, out) = (folder.path().join("study.toml"), folder.path().join("out"));
    quick::run(&study, &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
    let first = calls(folder.path());
    let fit = fs::read_to_string(out.join("5-calibrate-best-fit/fit.json")).unwrap();
    let fit: serde_json::Value = serde_json::from_str(&fit).unwrap();
    let slope = fit["point"][0].as_f64().unwrap();
    assert!((slope - product / squares).abs() < 1e-5, "{slope} {}", product / squares);
    let again = quick::run(&study, &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
    assert_eq!((again.made, calls(folder.path())), (Vec::<String>::new(), first));
    // Without the error of the replicates' mean there is no search for it.
    let settings = ["discrepancy.replicate_error=false"];
    let other = folder.path().join("other");
    quick::run(&study, &settings, &other).unwrap_or_else(|stop| panic!("{stop}"));
    assert!(!other.join("5-calibrate-best-fit").exists());
    let search = 2 * first - calls(folder.path());
    assert!(search < 1500, "the search takes {search} runs of the model");
}

/// A model may be meaningless outside of the prior: no difference is taken there.
#[test]
fn derivatives_at_the_ends_of_a_prior_stay_inside() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("study.toml"), STUDY).unwrap();
    let noted = MODEL.replace("calls.write(\"x\")", "calls.write(f\"{slope!r}\\n\")");
    fs::write(folder.path().join("line.py"), noted).unwrap();
    fs::write(folder.path().join("y.csv"), "replicate,time [s],y\n0,1,1.0\n").unwrap();
    let study = quick::load(&folder.path().join("study.toml"), &[]);
    let map = ModelMap::of(&study).unwrap();
    for slope in [0.0, 1.0, 2.0] {
        let (mean, jacobian) = map.mean_and_jacobian(&[slope]);
        for (i, time) in (1..=8).map(f64::from).enumerate() {
            assert!((mean[i] - slope * time).abs() < 1e-12);
            assert!((jacobian[(i, 0)] - time).abs() < 1e-8, "{slope}: {}", jacobian[(i, 0)]);
        }
    }
    let text = fs::read_to_string(folder.path().join("calls")).unwrap();
    let slopes: Vec<f64> = text.lines().map(|line| line.parse().unwrap()).collect();
    // The points, a neighbour of each end and two of the middle.
    assert_eq!(slopes.len(), 7);
    assert!(slopes.iter().all(|slope| (0.0..=2.0).contains(slope)), "{slopes:?}");
}

const DECAY: &str = r#"
[study]
name = "decay"
title = "Two decays"
seed = 3

[[parameter]]
name = "rate"
unit = "1/s"
prior = { uniform = [0.1, 2.0] }

[response]
name = "y"
axes = { kind = ["fast", "slow"], time = { first = 0.5, last = 5.0, count = 10, unit = "s" } }

[model]
use = "equations"
state = { a = 1, b = 1 }
rate = { a = "-2 * rate * a", b = "-rate * b" }
observe = { fast = "a", slow = "b" }

[forward]
"#;

/// Closed form: `exp(-k rate t)`. Where only times up to 1.5 s are needed, the equations are integrated as far as there: the
/// values beyond are the last ones.
#[test]
fn equations_are_integrated_as_far_as_is_needed() {
    let checked = load_text(Path::new("study.toml"), DECAY, &[]);
    let complaints = checked.complaints();
    let study = checked.study.unwrap_or_else(|| panic!("{complaints}"));
    let map = ModelMap::of(&study).unwrap();
    let mut needed = [false; 20];
    needed[0] = true;
    needed[12] = true;
    let rate = 0.7;
    let mean = map.mean_at(&needed, &Matrix::from_vec(1, 1, vec![rate]));
    let wanted = Wanted { parameters: &[0], outputs: Some(&needed) };
    let (also, slopes) = map.mean_and_jacobian_by(&[rate], wanted);
    for i in 0..20 {
        let (k, t) = (if i < 10 { 2.0 } else { 1.0 }, 0.5 * (1 + i % 10) as f64);
        let until = t.min(1.5);
        let exact = f64::exp(-k * rate * until);
        assert!((mean[(0, i)] - exact).abs() < 1e-5, "{i}: {} {exact}", mean[(0, i)]);
        assert!((also[i] - exact).abs() < 1e-5, "{i}: {} {exact}", also[i]);
        let slope = if t > 1.5 { 0.0 } else { -k * t * exact };
        assert!((slopes[(i, 0)] - slope).abs() < 1e-4, "{i}: {} {slope}", slopes[(i, 0)]);
    }
}
