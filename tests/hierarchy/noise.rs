//! Variances of a discrepancy and unknowns of an effect by group.

use std::fmt::Write as _;
use std::fs;

use generator::noise::Source;

use super::{number, run};
use crate::quick;

/// Noise and gain of two targets, each with two scenarios.
const TARGETS: [(&str, f64, f64); 2] = [("T24", 0.05, 1.0), ("T26", 0.2, 1.3)];

const STUDY: &str = r#"
[study]
name = "noise"
title = "Noise and gain of two targets"
seed = 4

[[parameter]]
name = "level"
prior = { normal = [5.0, 0.01] }

[[scenario]]
name = "T24 first"
labels = { target = "T24" }

[[scenario]]
name = "T24 second"
labels = { target = "T24" }

[[scenario]]
name = "T26 first"
labels = { target = "T26" }

[[scenario]]
name = "T26 second"
labels = { target = "T26" }

[response]
name = "strain"
axes = { t = { first = 1.0, last = 10.0, count = 10, unit = "s" } }

[model]
use = "equations"
observe = "level * exp(-t / (20 {s}))"

[measurements]
use = "csv"
path = "strain.csv"

[[effect]]
use = "gain"
by = "target"
factor = { normal = [1.0, 0.5] }

[discrepancy]
use = "gaussian"
by = "target"
variance = { log_uniform = [1e-6, 1e2] }
replicate_error = false

[sampler]
use = "no_u_turn"
steps = 800
warm_up = 300
"#;

/// Each target has 120 values. Their variance is known to the relative standard error √(2 / 120), the gain to the noise over the
/// root of the sum of the squared responses and the error of the level.
#[test]
fn noise_and_gain_of_each_target_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Source::new(7);
    let mut table = "scenario,replicate,t [s],strain\n".to_owned();
    for (name, noise, gain) in TARGETS {
        for which in ["first", "second"] {
            for replicate in 0..6 {
                for t in 1..=10 {
                    let y = gain * 5.0 * (-f64::from(t) / 20.0).exp() + noise * random.normal();
                    writeln!(table, "{name} {which},{replicate},{t},{y}").unwrap();
                }
            }
        }
    }
    fs::write(folder.path().join("strain.csv"), table).unwrap();
    fs::write(folder.path().join("study.toml"), STUDY).unwrap();
    run(folder.path(), &[]);
    let summary = quick::summary(&folder.path().join("out"));
    for (name, noise, gain) in TARGETS {
        let variance = number(&summary, &format!("/parameters/variance[{name}]/mean"));
        let ratio = variance / (noise * noise);
        assert!((ratio - 1.0).abs() < 4.0 * (2.0_f64 / 120.0).sqrt(), "{name}: {ratio}");
        let found = &summary["parameters"][format!("gain[{name}].factor")];
        let off = number(found, "/mean") - gain;
        assert!(off.abs() < 4.0 * number(found, "/sd"), "{name}: {off}");
        assert!(number(found, "/sd") < 0.02, "{found}");
    }
}
