//! Terms found without being named, in a study without `[gap]`: the truth is an oscillator that the generator
//! integrates by a scheme of its own.

use std::fmt::Write as _;
use std::fs;

use generator::oscillator::Oscillator;
use lacuna::math::random::{Stream, normal};
use lacuna::run::Silent;
use lacuna_engine::augment::{Begun, add};
use lacuna_engine::gap::result::GapResult;
use lacuna_engine::gap::search::VerdictKind;
use lacuna_run::RunDirectory;

use super::inside::{loaded, study};

const STUDY: &str = r#"
[study]
title = "a mass on a spring"

[[parameter]]
name = "stiffness"
unit = "1/s2"
prior = { uniform = [20.0, 60.0] }

[[parameter]]
name = "damping"
unit = "1/s"
prior = { uniform = [0.0, 1.0] }

[response]
name = "x"
unit = "m"
axes = { t = { first = 0.05, last = 6.0, count = 120, unit = "s" } }

[model]
use = "equations"
state = { x = { start = 0.1, unit = "m" }, v = { start = 0.0, unit = "m/s" } }
rate = { x = "v", v = "-stiffness * x - damping * v" }
observe = "x"

[measurements]
use = "csv"
path = "data.csv"

[discrepancy]
use = "gaussian"
variance = { half_normal = 1.0 }

[sampler]
use = "affine_invariant_ensemble"
walkers = 16
steps = 100
"#;

const PLAIN: Oscillator =
    Oscillator { stiffness: 40.0, damping: 0.2, cubic: 0.0, quadratic: 0.0, start: 0.1 };

/// Result of a search in data of this oscillator, and the study that is written if something is to be added.
fn searched(truth: Oscillator) -> (GapResult, Option<String>) {
    let curve = truth.deflection(50, 120);
    let times: Vec<f64> = (1..=120).map(|i| 0.05 * f64::from(i)).collect();
    let at = |t: f64| curve[(t / 0.05).round() as usize - 1];
    let (folder, study) = study(STUDY, at, &times, 2e-3);
    let path = folder.path().join("study.toml");
    fs::write(&path, &study.text).unwrap();
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    let findings = lacuna_engine::pipeline::find_gap(&study, &mut run, &Silent).unwrap();
    let gap = findings.gap.as_ref().unwrap();
    let written = (!gap.result.additions.is_empty()).then(|| {
        let begun = Begun {
            study: &study,
            path: &path,
            folder: None,
            settings: &[],
            findings: &findings,
            gap,
        };
        let (added, _) = add(&begun, &run, &Silent).unwrap();
        fs::read_to_string(&added.study).unwrap()
    });
    (gap.result.clone(), written)
}

fn names(result: &GapResult, kind: &str, coefficient: f64) {
    let kinds: Vec<&str> = result.additions.iter().map(|a| a.kind.as_str()).collect();
    let leaders: Vec<_> = result.path.iter().map(|step| &step.leaders).collect();
    assert_eq!(kinds, [kind], "{leaders:#?}");
    // Where data do not determine an exponent, a law and the form that contains it are a class, the law first.
    let class = &result.verdict.effects[0].class;
    let alone = result.verdict.word == VerdictKind::Named;
    assert!(alone || class[..] == [kind, "power_friction"], "{class:?} {leaders:#?}");
    let found = &result.additions[0].unknowns[0];
    assert!((found.value - coefficient).abs() < 4.0 * found.sd, "{found:?}");
    assert!(result.held_out[0].proof.shrank, "{:?}", result.held_out);
}

#[test]
fn a_spring_that_hardens_is_named_unasked() {
    let (result, text) = searched(Oscillator { cubic: 600.0, ..PLAIN });
    names(&result, "cubic_stiffness", 600.0);
    let text = text.unwrap();
    let rate = r#"v = "-stiffness * x - damping * v + cubic_stiffness * (-(x)^3)""#;
    assert!(text.contains(rate) && text.contains("name = \"cubic_stiffness\""), "{text}");
}

/// The linear drag of the study replaced the quadratic one: beside the quadratic one it is not needed.
#[test]
fn a_term_that_stood_in_for_another_is_needless() {
    let (result, text) = searched(Oscillator { quadratic: 1.5, damping: 0.0, ..PLAIN });
    names(&result, "quadratic_friction", 1.5);
    let own: Vec<&str> = result.needless.iter().map(|piece| piece.name.as_str()).collect();
    assert_eq!(own, ["damping"], "{:?}", result.needless);
    assert!(text.unwrap().contains("the study's own `damping` is not needed"));
}

#[test]
fn a_drag_with_the_square_of_the_speed_is_named_unasked() {
    let (result, _) = searched(Oscillator { quadratic: 1.5, ..PLAIN });
    names(&result, "quadratic_friction", 1.5);
    assert!(result.needless.is_empty(), "{:?}", result.needless);
}

#[test]
fn where_the_equations_are_right_no_term_is_named() {
    let (result, text) = searched(PLAIN);
    assert_eq!(result.verdict.word, VerdictKind::None, "{:?}", result.verdict);
    assert!(text.is_none());
}

const ACTUATOR: &str = r#"
[study]
title = "an actuator with a lag"

[[parameter]]
name = "lag"
unit = "s"
prior = { uniform = [0.3, 3.0] }

[[scenario]]
name = "drive"
functions = { drive = { path = "drive.csv", at = "t", value = "u" } }

[response]
name = "x"
unit = "m"
axes = { t = { first = 0.05, last = 12.0, count = 240, unit = "s" } }

[model]
use = "equations"
state = { x = { start = 0.0, unit = "m" } }
rate = { x = "(drive(t) - x) / lag" }
observe = "x"

[measurements]
use = "csv"
path = "data-{scenario}.csv"

[discrepancy]
use = "gaussian"
variance = { half_normal = 1.0 }

[sampler]
use = "affine_invariant_ensemble"
walkers = 16
steps = 100
"#;

/// An actuator that cannot follow its drive beyond 0.6 m. Its drive is a table of the time, which the terms of the library
/// take as argument.
#[test]
fn an_actuator_that_saturates_is_named_unasked() {
    let drive = |t: f64| (1.1 * t).sin() + 0.4 * (2.7 * t).cos();
    let at = |t: f64| {
        let (k, share) = ((t / 0.05).floor(), (t / 0.05).fract());
        (1.0 - share) * drive(0.05 * k) + share * drive(0.05 * (k + 1.0))
    };
    let rate = |t: f64, x: f64| at(t).clamp(-0.6, 0.6) - x;
    let folder = tempfile::tempdir().unwrap();
    let (mut table, mut data) = ("t [s],u [m]\n".to_owned(), "replicate,t [s],x [m]\n".to_owned());
    let (h, mut x) = (0.001, 0.0);
    let mut rng = Stream::root(5).generator();
    for k in 0..12_000 {
        let t = h * f64::from(k);
        if k % 50 == 0 {
            writeln!(table, "{t:.3},{}", drive(t)).unwrap();
        }
        let first = rate(t, x);
        let middle = rate(t + 0.5 * h, x + 0.5 * h * first);
        x += h * middle;
        if (k + 1) % 50 == 0 {
            for r in 0..4 {
                writeln!(data, "{r},{:.3},{}", t + h, x + 2e-3 * normal(&mut rng)).unwrap();
            }
        }
    }
    writeln!(table, "12.0,{}", drive(12.0)).unwrap();
    fs::write(folder.path().join("drive.csv"), table).unwrap();
    fs::write(folder.path().join("data-drive.csv"), data).unwrap();
    let study = loaded(&folder, ACTUATOR);
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    let findings = lacuna_engine::pipeline::find_gap(&study, &mut run, &Silent).unwrap();
    let result = findings.gap.unwrap().result;
    let kinds: Vec<&str> = result.additions.iter().map(|a| a.kind.as_str()).collect();
    assert_eq!(kinds, ["limiter"], "{:?} {:?}", result.verdict, result.untried);
    let limit = &result.additions[0].unknowns[1];
    assert!((limit.value - 0.6).abs() < 4.0 * limit.sd.max(2e-3), "{limit:?}");
}
