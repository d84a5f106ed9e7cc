//! Pieces missing inside the model, in data made by exact solutions: a damper that the study fixes at zero, the drag of
//! a falling body.

use std::fmt::Write as _;
use std::fs;

use lacuna::math::random::{Stream, normal};
use lacuna::run::Silent;
use lacuna::text::emit::to_toml;
use lacuna_engine::augment::{Begun, add};
use lacuna_engine::gap::edit::Edit;
use lacuna_engine::gap::experiment::Experiment;
use lacuna_engine::gap::inside::{Pieces, alternatives, candidates};
use lacuna_engine::gap::noise::{Noise, ResponseTangents};
use lacuna_engine::gap::search::{Verdict, VerdictKind, search, verdict};
use lacuna_engine::gap::system::System;
use lacuna_engine::gap::system::fit::fit;
use lacuna_engine::gap::system::whitener::Whitener;
use lacuna_engine::stage::direct::Direct;
use lacuna_engine::study::Study;
use lacuna_engine::study::resolve::load_text;
use lacuna_linalg::Matrix;
use lacuna_run::RunDirectory;
use tempfile::TempDir;

use super::cases::options;

const REPLICATES: usize = 8;

/// A study in its own folder, with replicates of a curve plus white noise.
pub fn study(
    text: &str,
    curve: impl Fn(f64) -> f64,
    times: &[f64],
    noise: f64,
) -> (TempDir, Study) {
    let folder = tempfile::tempdir().unwrap();
    let mut csv = "replicate,t [s],x [m]\n".to_owned();
    for r in 0..REPLICATES {
        let mut rng = Stream::root(11).at(r as u64).generator();
        for &t in times {
            writeln!(csv, "{r},{t},{}", curve(t) + noise * normal(&mut rng)).unwrap();
        }
    }
    fs::write(folder.path().join("data.csv"), csv).unwrap();
    let study = loaded(&folder, text);
    (folder, study)
}

pub fn loaded(folder: &TempDir, text: &str) -> Study {
    let checked = load_text(&folder.path().join("study.toml"), text, &[]);
    let complaints = checked.complaints();
    checked.study.unwrap_or_else(|| panic!("{complaints}\n{text}"))
}

const REST: &str = r#"
[measurements]
use = "csv"
path = "data.csv"

[discrepancy]
use = "gaussian"
variance = { half_normal = 1.0 }

[sampler]
use = "affine_invariant_ensemble"
"#;

const OSCILLATOR: &str = r#"
[study]
title = "a mass on a spring"

[[parameter]]
name = "stiffness"
unit = "N/m"
prior = { uniform = [80.0, 120.0] }

[response]
name = "x"
unit = "m"
axes = { t = { first = 0.1, last = 8.0, count = 80, unit = "s" } }

[model]
use = "equations"
state = { x = { start = 0.01, unit = "m" }, v = { start = 0.0, unit = "m/s" } }
rate = { x = "v", v = "-(stiffness * x + drag * v) / mass" }
observe = "x"
fixed = { drag = { value = 0.0, unit = "kg/s" }, mass = { value = 2.0, unit = "kg" } }
"#;

const PIECES: &str = r#"
[gap]
candidates = []

[[gap.switch]]
input = "drag"
prior = { half_normal = 1.0 }
title = "a damper"

[[gap.term]]
use = "quadratic_friction"
state = "v"

[[gap.term]]
use = "coulomb_friction"
state = "v"

[[gap.term]]
use = "cubic_stiffness"
state = "v"
of = "x"
"#;

const STIFFNESS: f64 = 101.0;
const DRAG: f64 = 0.2;

/// The damped oscillator (Landau and Lifshitz, Mechanics, section 25) with mass 2, released from rest at 0.01.
fn damped(t: f64) -> f64 {
    let rate = DRAG / 4.0;
    let omega = (STIFFNESS / 2.0 - rate * rate).sqrt();
    0.01 * (-rate * t).exp() * ((omega * t).cos() + rate / omega * (omega * t).sin())
}

fn times() -> Vec<f64> {
    (1..=80).map(|i| 0.1 * f64::from(i)).collect()
}

/// Verdict of the search with only the candidates inside the model, the point it found, and its edit of the study.
fn ask(folder: &TempDir, study: &Study, start: &[f64]) -> (Verdict, Vec<f64>, Edit) {
    let pieces = Pieces::of(study).unwrap().unwrap();
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    let prepared = Direct::of(study, &mut run, &Silent).unwrap();
    let known = prepared.problem();
    let (candidates, wide) = candidates(&pieces, study, &known, &mut run, &Silent).unwrap();
    let measured = &known.data.value.measured.as_ref().unwrap().used;
    let forward = known.forward();
    let mut experiment = Experiment::new(&study.layouts, &study.parameters, forward, measured);
    experiment.wide = Some(&wide);
    let options = options();
    let starts = [start.to_vec()];
    let found = search(&experiment, &candidates, &starts, options, &Stream::root(5)).unwrap();
    let switches: Vec<&[usize]> =
        found.system.effects.iter().map(|effect| effect.effect.switches()).collect();
    let edit = pieces.edit(study, &switches);
    agrees(
        folder,
        study,
        &edit,
        &found.system.response(&found.last.fit.at.point),
        &found.last.fit.at.point,
    );
    (verdict(&found, &candidates, options), found.last.fit.at.point.clone(), edit)
}

/// Checks that the study that is written has the response that the search found.
fn agrees(folder: &TempDir, study: &Study, edit: &Edit, response: &[f64], point: &[f64]) {
    let text = to_toml(&edit.applied(&study.resolved).unwrap()).unwrap();
    let written = loaded(folder, &text);
    let mut run = RunDirectory::open(&folder.path().join("written")).unwrap();
    let prepared = Direct::of(&written, &mut run, &Silent).unwrap();
    let again = prepared.problem().forward().mean(&Matrix::from_rows(point.len(), [point]));
    let largest = response.iter().fold(0.0, |most: f64, y| most.max(y.abs()));
    for (a, b) in again.row(0).iter().zip(response) {
        assert!((a - b).abs() < 1e-7 * largest, "{a} {b}\n{text}");
    }
}

fn kinds(verdict: &Verdict) -> Vec<&str> {
    verdict.effects.iter().map(|effect| effect.kind.as_str()).collect()
}

#[test]
fn a_damper_that_the_study_holds_at_zero_is_found() {
    let text = [OSCILLATOR, REST, PIECES].concat();
    let (folder, study) = study(&text, damped, &times(), 5e-4);
    let (verdict, point, edit) = ask(&folder, &study, &[100.0]);
    assert_eq!(kinds(&verdict), ["drag"], "{verdict:?}");
    assert_eq!(verdict.word, VerdictKind::Named, "{verdict:?}");
    let found = &verdict.effects[0];
    assert!((found.values[0] - DRAG).abs() < 4.0 * found.sd[0], "{verdict:?}");
    assert!(found.sd[0] < 0.1 * DRAG, "{verdict:?}");
    assert!((point[0] - STIFFNESS).abs() < 0.5, "{point:?}");
    assert_eq!(edit.freed, ["drag"]);
}

const FALL: &str = r#"
[study]
title = "a falling body"

[[parameter]]
name = "gravity"
unit = "m/s2"
prior = { normal = [9.81, 0.02] }

[response]
name = "x"
unit = "m"
axes = { t = { first = 0.03, last = 1.5, count = 50, unit = "s" } }

[model] # free fall
use = "equations"
observe = "x"
state = { x = { start = 0.0, unit = "m" }, v = { start = 0.0, unit = "m/s" } }

[model.rate]
x = "v"
v = "gravity" # and nothing else
"#;

const NONE: &str = "\n[gap]\ncandidates = []\n";

const DRAGS: &str = r#"
[[gap.term]]
use = "linear_friction"
state = "v"

[[gap.term]]
use = "quadratic_friction"
state = "v"

[[gap.term]]
use = "expression"
name = "haste"
state = "v"
shape = "t / 1 {s}"
"#;

/// The fall of a body with quadratic drag (Parker, American Journal of Physics 45 (1977) 606, section I):
/// `x = u² / g ln cosh(g t / u)` with the terminal speed `u`, whose drag coefficient is `g / u²`.
#[test]
fn the_drag_of_a_falling_body_is_named() {
    let (g, terminal) = (9.81, 20.0);
    let fall = |t: f64| terminal * terminal / g * (g * t / terminal).cosh().ln();
    let times: Vec<f64> = (1..=50).map(|i| 0.03 * f64::from(i)).collect();
    let (folder, study) = study(&[FALL, REST, NONE, DRAGS].concat(), fall, &times, 0.02);
    let (verdict, _, edit) = ask(&folder, &study, &[9.81]);
    assert_eq!(kinds(&verdict), ["quadratic_friction"], "{verdict:?}");
    assert_eq!(verdict.word, VerdictKind::Named, "{verdict:?}");
    let found = &verdict.effects[0];
    let exact = g / (terminal * terminal);
    assert!((found.values[0] - exact).abs() < 4.0 * found.sd[0], "{verdict:?} {exact}");
    let text = edit.text(&study, "the drag that data show").unwrap();
    assert!(text.starts_with("\n[study]\ntitle = \"a falling body\"\n"), "{text}");
    let rate = r#"v = "gravity + quadratic_friction * (-(v) * abs(v))" # and nothing else"#;
    assert!(text.contains(rate), "{text}");
    assert!(text.contains("\n# the drag that data show\n[[parameter]]\nname = \"quadratic_friction\"\nunit = \"1/m\""), "{text}");
    assert!(text.contains("linear_friction") && !text.contains("use = \"quadratic"), "{text}");
}

const LEARNED: &str = r#"
[design]
use = "latin_hypercube"
runs = 60

[surrogate]
use = "polynomial_chaos"
"#;

/// An input that is learned from its own runs: the emulators agree where it is zero, and elsewhere the error is covered
/// by the covariance of the emulator's error.
#[test]
fn an_input_is_learned_from_runs_of_its_own() {
    let (folder, study) = {
        let text = OSCILLATOR.replace("last = 8.0, count = 80", "last = 2.0, count = 20");
        let switch = PIECES.split("\n[[gap.term]]").next().unwrap();
        study(&[&text, REST, LEARNED, switch].concat(), damped, &times()[..20], 5e-4)
    };
    let pieces = Pieces::of(&study).unwrap().unwrap();
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    let (learned, _) =
        lacuna_engine::pipeline::calibrate_emulated(&study, &mut run, &Silent).unwrap();
    let known = learned.problem();
    let (_, wide) = candidates(&pieces, &study, &known, &mut run, &Silent).unwrap();
    let at = |point: &[f64]| wide.forward.mean(&Matrix::from_rows(2, [point])).row(0).to_vec();
    let base = known.forward().mean(&Matrix::from_rows(1, [[STIFFNESS]]));
    assert_eq!(at(&[STIFFNESS, 0.0]), base.row(0));
    let said = wide.common[0].factor.as_slice().iter().map(|x| x * x).sum::<f64>() / 20.0;
    let errors = at(&[STIFFNESS, DRAG]).into_iter().zip(times());
    let made = errors.map(|(y, t)| (y - damped(t)).powi(2)).sum::<f64>() / 20.0;
    assert!(made < 9.0 * said && said.sqrt() < 1e-4, "{made:e} {said:e}");
    let jacobian = wide.forward.jacobian(&[STIFFNESS, DRAG]);
    for (j, step) in [1e-3, 1e-5].into_iter().enumerate() {
        let moved = |h: f64| {
            let mut point = [STIFFNESS, DRAG];
            point[j] += h;
            at(&point)
        };
        for (i, (a, b)) in moved(step).into_iter().zip(moved(-step)).enumerate() {
            let slope = (a - b) / (2.0 * step);
            let bound = 1e-5 * slope.abs().max(1e-3 / [40.0, 1.0][j]);
            assert!((jacobian[(i, j)] - slope).abs() < bound, "{} {slope}", jacobian[(i, j)]);
        }
    }
    let (_, again) = candidates(&pieces, &study, &known, &mut run, &Silent).unwrap();
    let there = again.forward.mean(&Matrix::from_rows(2, [[STIFFNESS, DRAG]]));
    assert_eq!(at(&[STIFFNESS, DRAG]), there.row(0));
}

const MODELS: &str = r#"
[[gap.model]]
name = "damped"
use = "equations"
state = { x = { start = 0.01, unit = "m" }, v = { start = 0.0, unit = "m/s" } }
rate = { x = "v", v = "-(stiffness * x + drag * v) / mass" }
observe = "x"
fixed = { drag = { value = 0.2, unit = "kg/s" } }

[[gap.model]]
name = "same"
use = "equations"
state = { x = { start = 0.01, unit = "m" }, v = { start = 0.0, unit = "m/s" } }
rate = { x = "v", v = "-stiffness * x / mass" }
observe = "x"
"#;

/// Models side by side: the one that made the data wins by its likelihood, one that equals the study's own gains
/// nothing.
#[test]
fn another_model_is_weighed_after_its_own_calibration() {
    let text = [OSCILLATOR, REST, MODELS].concat();
    let (folder, study) = study(&text, damped, &times(), 5e-4);
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    let prepared = Direct::of(&study, &mut run, &Silent).unwrap();
    let known = prepared.problem();
    let alternatives = alternatives(&study, &known, &mut run, &Silent).unwrap();
    let measured = &known.data.value.measured.as_ref().unwrap().used;
    let experiment = Experiment::new(&study.layouts, &study.parameters, known.forward(), measured);
    let system = System::new(&experiment, Vec::new());
    let response = system.response(&[100.0]);
    let noise = Noise::of(&experiment, &ResponseTangents::fixed(&response), None);
    let whitener = Whitener::new(&experiment, &noise, &response);
    let means = experiment.means().1;
    let base = fit(&system, &whitener, &means, &[100.0]);
    let compared: Vec<_> = alternatives
        .iter()
        .map(|r| r.compare(&experiment, Vec::new(), &base, &noise, &Stream::root(4)).unwrap())
        .collect();
    assert!(compared[0].log_odds > 20.0, "{compared:?}");
    let stiffness = &compared[0].parameters[0];
    assert!((stiffness.value - STIFFNESS).abs() < 4.0 * stiffness.sd, "{stiffness:?}");
    let same = &compared[1];
    assert!(same.log_odds.abs() < 4.0 * same.error + 1e-3, "{same:?}");
    let text = to_toml(&alternatives[0].edit.applied(&study.resolved).unwrap()).unwrap();
    let written = loaded(&folder, &text);
    assert_eq!(written.plugins.model.unwrap().common.fixed.len(), 2, "{text}");
}

/// The complete workflow: the drag is found among effects on the response, confirmed on held-out replicates, written
/// into the equations of the study, and sampled with its parameter.
#[test]
fn the_study_with_the_drag_is_written_and_run() {
    let (g, terminal) = (9.81, 20.0);
    let fall = |t: f64| terminal * terminal / g * (g * t / terminal).cosh().ln();
    let times: Vec<f64> = (1..=50).map(|i| 0.03 * f64::from(i)).collect();
    let rest = REST.replace(r#"ensemble""#, "ensemble\"\nwalkers = 16\nsteps = 200");
    let own = "\n[gap]\ncandidates = [\"gain\", \"drift\"]\nsimulations = 99\n";
    let (folder, study) = study(&[FALL, &rest, own, DRAGS].concat(), fall, &times, 0.02);
    let path = folder.path().join("study.toml");
    fs::write(&path, &study.text).unwrap();
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    let findings = lacuna_engine::pipeline::find_gap(&study, &mut run, &Silent).unwrap();
    let gap = findings.gap.as_ref().unwrap();
    let result = &gap.result;
    let kinds: Vec<&str> = result.additions.iter().map(|a| a.kind.as_str()).collect();
    assert_eq!(
        (result.verdict.word, &kinds[..]),
        (VerdictKind::Named, &["quadratic_friction"][..])
    );
    assert!(result.held_out[0].proof.shrank, "{:?}", result.held_out);
    let begun =
        Begun { study: &study, path: &path, folder: None, settings: &[], findings: &findings, gap };
    let (added, _) = add(&begun, &run, &Silent).unwrap();
    assert!(added.held_out[0].proof.shrank, "{:?}", added.held_out);
    let unknown = &added.unknowns[0];
    assert_eq!(unknown.name, "quadratic_friction");
    let exact = g / (terminal * terminal);
    assert!((unknown.mean - exact).abs() < 4.0 * unknown.sd, "{unknown:?} {exact}");
    let text = fs::read_to_string(&added.study).unwrap();
    assert!(text.contains("# and nothing else") && !text.contains("[[effect]]"), "{text}");
}
