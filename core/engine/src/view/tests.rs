//! Data of runs whose files are incomplete.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::fs;
use std::path::Path;

use lacuna::data::Unit;
use lacuna::diagnose::chains;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::sampler::{Plan, State};
use lacuna_linalg::Matrix;
use lacuna_run::RunDirectory;
use serde_json::json;

use super::{Answer, GapState, RunState, ServedFolder, Watched};
use crate::posterior::CoordinateScale;
use crate::stage::calibrate::{Outline, OutlinedCoordinate};

const CHAINS: usize = 4;
const STEPS: usize = 200;

/// Coordinates of chain `c` at step `s`: a value around 5 and the logarithm of a variance; the last chain is apart.
fn point(c: usize, s: usize) -> [f64; 2] {
    let mut rng = Stream::root(7).at((1000 * c + s) as u64).generator();
    let apart = if c + 1 == CHAINS { 3.0 } else { 0.0 };
    [5.0 + apart + normal(&mut rng), 0.1 * normal(&mut rng)]
}

/// The file of draws, by its description in `stage/sampling/log.rs`: for each step the values of each chain (point, log
/// density, one statistic) and then one byte for each chain.
fn draws(steps: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    for s in 0..steps {
        for c in 0..CHAINS {
            let [x, y] = point(c, s);
            bytes.extend([x, y, -1.0, 0.5].iter().flat_map(|value: &f64| value.to_le_bytes()));
        }
        bytes.extend([1_u8; CHAINS]);
    }
    bytes
}

fn outline() -> Outline {
    let one = |name: &str, unit: &str, scale| OutlinedCoordinate {
        name: name.to_owned(),
        symbol: name.to_owned(),
        unit: Unit::parse(unit).unwrap(),
        scale,
    };
    Outline {
        coordinates: vec![
            one("length", "m", CoordinateScale::Natural),
            one("variance", "m^2", CoordinateScale::Logarithmic),
        ],
        plan: Plan { chains: CHAINS, steps: 400, warm_up: 0, ensemble: false },
        burn_in: 0.5,
        steps_are_draws: true,
    }
}

/// A run that is sampling: a checkpoint after [`STEPS`] steps, and more in the file, of which the last is half written.
fn half_written(root: &Path) {
    let calibrate = root.join("5-calibrate");
    fs::create_dir_all(&calibrate).unwrap();
    let study = "[study]\nname = \"rope\"\ntitle = \"A rope <of> 5 m\"\n";
    fs::write(root.join("resolved.toml"), study).unwrap();
    fs::write(calibrate.join("inputs.sha256"), "abc\n").unwrap();
    outline().write(&calibrate).unwrap();
    let whole = draws(STEPS + 3);
    fs::write(calibrate.join("draws.bin"), &whole[..whole.len() - 50]).unwrap();
    let state = State {
        points: Matrix::from_fn(CHAINS, 2, |c, j| point(c, STEPS - 1)[j]),
        log_density: vec![-1.0; CHAINS],
        accepted: vec![true; CHAINS],
        evaluations: 812,
        memory: json!(null),
    };
    let checkpoint = json!({
        "step": STEPS, "inputs": "abc", "state": state, "planned": 400,
        "statistics": [["energy", "number"]],
    });
    fs::write(calibrate.join("state.json"), checkpoint.to_string()).unwrap();
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * a.abs().max(b.abs())
}

#[test]
fn chains_are_diagnosed_while_they_are_written() {
    let folder = tempfile::tempdir().unwrap();
    half_written(folder.path());
    let found = Watched::read(folder.path(), "rope");
    assert_eq!(
        (found.row.state, found.row.stage.as_deref()),
        (RunState::Stopped, Some("calibrate"))
    );
    assert_eq!(found.row.title, "A rope <of> 5 m");
    let sampling = found.sampling.unwrap();
    assert_eq!((sampling.steps, sampling.planned, sampling.burn_in), (STEPS, 400, STEPS / 2));
    assert_eq!((sampling.chains, sampling.every, sampling.evaluations), (CHAINS, 1, 812));
    // The draws as they were made, without the file.
    let kept = |of: fn([f64; 2]) -> f64| -> Vec<Vec<f64>> {
        (0..CHAINS).map(|c| (STEPS / 2..STEPS).map(|s| of(point(c, s))).collect()).collect()
    };
    for (found, values) in sampling.coordinates.iter().zip([kept(|p| p[0]), kept(|p| p[1].exp())]) {
        assert!(close(found.r_hat, chains::r_hat(&values)), "{found:?}");
        assert!(close(found.ess_bulk, chains::ess_bulk(&values)), "{found:?}");
        assert!(close(found.ess_tail, chains::ess_tail(&values)), "{found:?}");
        let pooled = values.concat();
        assert!(close(found.mean, pooled.iter().sum::<f64>() / pooled.len() as f64), "{found:?}");
    }
    // One chain is three standard deviations away from the others.
    // ArviZ finds 1.41 to 1.49 in five such sets of draws, and at most 1.01 in sets without such a chain.
    let r_hats: Vec<f64> = sampling.coordinates.iter().map(|c| c.r_hat).collect();
    assert!(r_hats[0] > 1.3 && r_hats[1] < 1.05, "{r_hats:?}");
    assert!(!sampling.meets);
    let trace = &sampling.traces[0];
    assert_eq!((trace.chains.len(), trace.burn_in, trace.label.as_str()), (4, 100, "length [m]"));
    assert_eq!(trace.chains[2][0], point(2, 0)[0]);
}

#[test]
fn draws_that_are_not_those_of_the_checkpoint_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    half_written(folder.path());
    let calibrate = folder.path().join("5-calibrate");
    let sampling = || Watched::read(folder.path(), "rope").sampling;
    assert!(sampling().is_some());
    // Another attempt has begun, and has not come as far.
    fs::write(calibrate.join("draws.bin"), &draws(STEPS)[..1000]).unwrap();
    assert_eq!(sampling(), None);
    fs::write(calibrate.join("draws.bin"), draws(STEPS)).unwrap();
    assert!(sampling().is_some());
    // The study has changed.
    fs::write(calibrate.join("inputs.sha256"), "def\n").unwrap();
    assert_eq!(sampling(), None);
    fs::write(calibrate.join("inputs.sha256"), "abc\n").unwrap();
    let state = fs::read(calibrate.join("state.json")).unwrap();
    // Sizes that no file holds.
    let stated: serde_json::Value = serde_json::from_slice(&state).unwrap();
    for (steps, rows, columns, data) in [
        (json!(u64::MAX), 2_u64, 1, json!([0.0, 0.0])),
        (json!(1_u64 << 40), 1_u64, 1, json!([0.0])),
        (json!(0), 1_u64 << 40, 0, json!([])),
    ] {
        let mut other = stated.clone();
        other["step"] = steps;
        other["state"]["points"] = json!({ "rows": rows, "columns": columns, "data": data });
        fs::write(calibrate.join("state.json"), other.to_string()).unwrap();
        assert_eq!(sampling(), None);
    }
    fs::write(calibrate.join("state.json"), &state[..state.len() / 2]).unwrap();
    assert_eq!(sampling(), None);
    fs::remove_file(calibrate.join("sampling.json")).unwrap();
    assert_eq!(sampling(), None);
}

#[test]
fn pages_are_made_of_what_is_there() {
    let runs = tempfile::tempdir().unwrap();
    fs::create_dir(runs.path().join("notes")).unwrap();
    let rope = runs.path().join("a rope+effect");
    half_written(&rope);
    let roll = json!({ "scenarios": [["", ""]], "runs": ["run1", "run2"] });
    fs::create_dir(rope.join("2-simulate")).unwrap();
    fs::write(rope.join("2-simulate/asked.json"), roll.to_string()).unwrap();
    let progress = json!({
        "stage": "calibrate", "unit": "step", "done": 210, "total": 400, "begun": 1, "written": 2,
        "ended": [], "warnings": ["<b>a warning</b>"], "stopped": null,
    });
    fs::write(rope.join("progress.json"), progress.to_string()).unwrap();
    // A temporary folder has a hidden name.
    let hidden = runs.path().join(".rope");
    half_written(&hidden);
    let served = ServedFolder::open(&hidden).unwrap();
    assert_eq!(served.only(), Some("rope"));
    assert!(matches!(served.answer("/runs/rope/", ""), Answer::Page(_)));
    let served = ServedFolder::open(runs.path()).unwrap();
    assert_eq!(served.names(), ["a rope+effect"]);
    let page = |path: &str| match served.answer(path, "") {
        Answer::Page(text) => text,
        other => panic!("{path}: {other:?}"),
    };
    let list = page("/");
    assert!(list.contains("href=\"/runs/a%20rope%2Beffect/\""), "{list}");
    assert!(list.contains("A rope &lt;of&gt; 5 m") && list.contains("calibrate, 52.5 %"), "{list}");
    let run = page("/runs/a%20rope+effect/");
    for part in [
        "data-state=\"stopped\"",
        "<progress max=\"400\" value=\"210\"",
        "&lt;b&gt;a warning&lt;/b&gt;",
        "length [m]",
        "R-hat should be at most 1.01",
        "2 runs are not done",
        "5-calibrate",
    ] {
        assert!(run.contains(part), "no {part} in {run}");
    }
    let Answer::Json(text) = served.answer("/api/runs/a%20rope%2Beffect", "") else { panic!() };
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(value["state"], "stopped");
    assert_eq!(value["share"], 0.525);
    assert_eq!(value["progress"]["unit"], "step");
    assert_eq!(value["sampling"]["coordinates"][1]["scale"], "logarithmic");
    assert_eq!(value["campaign"]["counts"][0]["missing"], 2);
    assert_eq!(value["gap"], serde_json::Value::Null);
}

#[test]
fn a_gap_search_goes_on_while_its_process_works() {
    let folder = tempfile::tempdir().unwrap();
    half_written(folder.path());
    let gap = || Watched::read(folder.path(), "rope").gap;
    assert_eq!(gap(), None);
    for part in ["7-gap", "7-gap-simulate", "7-power"] {
        fs::create_dir(folder.path().join(part)).unwrap();
        fs::write(folder.path().join(part).join("inputs.sha256"), "abc\n").unwrap();
    }
    let run = RunDirectory::open(folder.path()).unwrap();
    let found = gap().unwrap();
    assert_eq!((found.state, found.verdict.as_deref()), (GapState::Searching, None));
    assert_eq!(found.parts, [("7-gap-simulate".to_owned(), false)]);
    // Several may look at a time.
    assert!((0..4).all(|_| RunDirectory::is_busy(folder.path())));
    drop(run);
    assert_eq!(gap().unwrap().state, GapState::Stopped);
}

#[cfg(unix)]
#[test]
fn links_out_of_the_folder_are_refused() {
    let outside = tempfile::tempdir().unwrap();
    fs::write(outside.path().join("secret.txt"), "secret").unwrap();
    half_written(&outside.path().join("run"));
    let runs = tempfile::tempdir().unwrap();
    half_written(&runs.path().join("mine"));
    let link = std::os::unix::fs::symlink::<std::path::PathBuf, std::path::PathBuf>;
    link(outside.path().join("secret.txt"), runs.path().join("mine/secret.txt")).unwrap();
    link(outside.path().to_owned(), runs.path().join("mine/figures")).unwrap();
    link(outside.path().join("run"), runs.path().join("other")).unwrap();
    link("study.toml".into(), runs.path().join("mine/loop.toml")).unwrap();
    link("resolved.toml".into(), runs.path().join("mine/same.toml")).unwrap();
    let served = ServedFolder::open(runs.path()).unwrap();
    assert_eq!(served.names(), ["mine"]);
    for path in [
        "/runs/mine/secret.txt",
        "/runs/mine/figures/secret.txt",
        "/runs/other/resolved.toml",
        "/runs/other/",
        "/runs/mine/loop.toml",
        "/runs/mine/5-calibrate",
        "/runs/mine/..",
    ] {
        assert!(matches!(served.answer(path, ""), Answer::Refused(403 | 404, _)), "{path}");
    }
    assert!(matches!(served.answer("/runs/mine/same.toml", ""), Answer::File { length: 48, .. }));
}
