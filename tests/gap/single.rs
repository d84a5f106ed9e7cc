//! Studies of a single record: a drive whose amplifier has an offset that its model lacks, with the exact solution as
//! truth.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;

use generator::noise::Source;
use lacuna::run::Silent;
use lacuna_engine::gap::result::GapResult;
use lacuna_engine::gap::search::VerdictKind;
use lacuna_run::RunDirectory;

use super::inside::loaded;

pub(super) const STUDY: &str = r#"
[study]
title = "a drive"
seed = 7

[[parameter]]
name = "gain"
unit = "m/s2"
prior = { log_uniform = [0.1, 10.0] }

[[parameter]]
name = "damping"
unit = "1/s"
prior = { log_uniform = [0.05, 10.0] }

[response]
name = "x"
unit = "m"
axes = { t = { first = 0.05, last = 10.0, count = 200, unit = "s" } }

[model]
use = "equations"
state = { x = { start = 0.0, unit = "m" }, v = { start = 0.0, unit = "m/s" } }
rate = { x = "v", v = "gain * sin(2 * pi * 0.3 {1/s} * t) - damping * v" }
observe = "x"

[measurements]
use = "csv"
path = "data.csv"
NOISE

[discrepancy]
use = "gaussian"
variance = { half_normal = 0.1 }

[sampler]
use = "no_u_turn"
warm_up = 40
steps = 60

[gap]
simulations = 99
"#;

const GAIN: f64 = 1.5;
const DAMPING: f64 = 0.9;
const NOISE: f64 = 1e-3;

/// The position of the drive with an offset of its acceleration: the solution of a linear equation.
fn position(offset: f64, t: f64) -> f64 {
    let (d, w) = (DAMPING, TAU * 0.3);
    let gone = (1.0 - (-d * t).exp()) / d;
    let swung = d / w * (1.0 - (w * t).cos()) - (w * t).sin() + w * gone;
    GAIN / (d * d + w * w) * swung + offset / d * (t - gone)
}

/// The result of a search in one record whose first value is off.
fn searched(offset: f64, off: f64, noise: &str) -> GapResult {
    let mut random = Source::new(5);
    let mut csv = "replicate,t [s],x [m]\n".to_owned();
    for i in 1..=200 {
        let t = 0.05 * f64::from(i);
        let first = if i == 1 { off } else { 0.0 };
        writeln!(csv, "0,{t},{}", position(offset, t) + first + NOISE * random.normal()).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("data.csv"), csv).unwrap();
    let study = loaded(&folder, &STUDY.replace("NOISE", noise));
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    let findings = lacuna_engine::pipeline::find_gap(&study, &mut run, &Silent).unwrap();
    findings.gap.unwrap().result
}

fn says(result: &GapResult, words: &str) -> bool {
    result.verdict.reasons.iter().any(|reason| reason.contains(words))
}

/// The offset is found with the noise assumed, stated, and stated in part; what the verdict says of the noise is right.
#[test]
fn the_offset_of_a_drive_is_a_constant_rate() {
    let offset = 0.05;
    for (noise, words) in [
        ("", "noise assumed: "),
        (
            "noise = { sd = { value = 1, unit = \"mm\" }, memory = 0 }",
            "that of `noise` in `[measurements]`",
        ),
        ("noise = { sd = 0.001 }", "noise assumed in part: "),
    ] {
        let result = searched(offset, 0.0, noise);
        let kinds: Vec<&str> = result.additions.iter().map(|a| a.kind.as_str()).collect();
        assert_eq!(
            (result.verdict.word, &kinds[..]),
            (VerdictKind::Named, &["constant_rate"][..]),
            "{noise}: {:?}",
            result.verdict
        );
        let found = &result.additions[0].unknowns[0];
        assert!((found.value - offset).abs() < 4.0 * found.sd, "{noise}: {found:?}");
        assert!(says(&result, words), "{noise}: {:?}", result.verdict);
    }
}

/// A first value that is off is said to be, and no effect explains it; without it nothing is said.
#[test]
fn a_start_up_transient_is_no_effect() {
    for off in [0.0, 0.1] {
        let result = searched(0.0, off, "");
        assert_eq!(result.verdict.word, VerdictKind::None, "{:?}", result.verdict);
        assert_eq!(says(&result, "a start-up transient: the first value of x is off"), off > 0.0);
    }
}
