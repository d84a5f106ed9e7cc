//! Studies without data: propagated priors against closed forms.

use std::f64::consts::PI;
use std::fs;
use std::path::Path;

use generator::{line, noise};
use lacuna_run::arrays;
use serde_json::Value;
use tempfile::TempDir;

use crate::quick;

/// Multiple of a standard error: exceeded with a probability of 6e-5 per figure.
const ERRORS: f64 = 4.0;

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("no {pointer}"))
}

/// The study of a line without its measurements, with more sections.
fn written(more: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(quick::root().join("tests/gate/study.toml")).unwrap();
    let (before, rest) = text.split_once("[measurements]").unwrap();
    let (_, rest) = rest.split_once("[surrogate]").unwrap();
    let (surrogate, _) = rest.split_once("[discrepancy]").unwrap();
    let text = format!("{before}[surrogate]{surrogate}{more}");
    fs::write(folder.path().join("study.toml"), text).unwrap();
    let [runs, responses] = line::runs(40, &mut noise::Source::new(5));
    fs::write(folder.path().join("runs.csv"), runs).unwrap();
    fs::write(folder.path().join("responses.csv"), responses).unwrap();
    folder
}

fn run(folder: &Path) -> (quick::Ran, Value) {
    let ran = quick::run(&folder.join("study.toml"), &[], &folder.join("out"));
    let ran = ran.unwrap_or_else(|stop| panic!("{stop}"));
    (ran, quick::summary(&folder.join("out")))
}

/// Requires the mean and the standard deviation of a prediction from independent draws; `kurtosis` is that of its law.
fn agrees(what: &str, found: &Value, (mean, variance, kurtosis): (f64, f64, f64)) {
    let draws = number(found, "/draws");
    let error = (variance / draws).sqrt();
    assert!((number(found, "/mean") - mean).abs() < ERRORS * error, "{what}: mean {found}");
    assert!((number(found, "/mcse_mean") / error - 1.0).abs() < 0.1, "{what}: error {found}");
    let ratio = number(found, "/sd").powi(2) / variance;
    assert!((ratio - 1.0).abs() < ERRORS * ((kurtosis - 1.0) / draws).sqrt(), "{what}: {ratio}");
}

/// Requires first-order indices, total indices and Shapley effects within their stated errors, and these below a bound.
fn shares(what: &str, found: &Value, input: &str, expected: [f64; 3], bound: f64) {
    for (key, truth) in ["first_order", "total", "shapley"].into_iter().zip(expected) {
        let value = number(found, &format!("/sensitivity/{input}/{key}"));
        let error = number(found, &format!("/sensitivity/{input}/{key}_error"));
        assert!(
            (value - truth).abs() < ERRORS * error && error < bound,
            "{what} {input} {key}: {value} ± {error} for {truth}"
        );
    }
}

/// With normal priors a line has a normal response; its maximum is at one of the two ends.
#[test]
fn a_line_with_normal_priors() {
    let folder = written(
        "\n[[quantity]]\nname = \"middle\"\nuse = \"at\"\nplace = 3.5\n\n[[quantity]]\nname = \"peak\"\nuse = \"maximum\"\n",
    );
    let (_, summary) = run(folder.path());
    let found = &summary["quantities"]["middle"];
    let variance = 1.0 + 0.25 * 3.5_f64.powi(2);
    agrees("middle", found, (0.0, variance, 3.0));
    shares("middle", found, "level0", [1.0 / variance; 3], 0.02);
    shares("middle", found, "rise", [1.0 - 1.0 / variance; 3], 0.02);
    for (key, z) in [("/q025", -1.959_964), ("/q975", 1.959_964)] {
        // The error of an outer quantile of a normal distribution is 2.7 times that of its mean.
        let off = number(found, key) - z * variance.sqrt();
        assert!(off.abs() < 2.7 * ERRORS * number(found, "/mcse_mean"), "{key} {off}");
    }
    assert_eq!(found["includes"], serde_json::json!(["emulator"]));
    assert!(found.get("map").is_none() && number(found, "/at_medians").abs() < 1e-9);
    // The maximum is level + rise + 5 max(rise, 0), a sum of independent terms.
    let peak = &summary["quantities"]["peak"];
    let mean = 5.0 * 0.5 / (2.0 * PI).sqrt();
    let of_rise = 0.25 * 18.5 - mean * mean;
    agrees("peak", peak, (mean, 1.0 + of_rise, 4.0));
    shares("peak", peak, "level0", [1.0 / (1.0 + of_rise); 3], 0.03);
    shares("peak", peak, "rise", [of_rise / (1.0 + of_rise); 3], 0.03);
    // The arrays have the same for each time: variance 1 + t² / 4.
    let path = folder.path().join("out/6-quantities/sensitivity.nc");
    let read = |name: &str| arrays::read(&path, name).unwrap().values;
    let (first, error) = (read("response_first_order"), read("response_first_order_error"));
    let (total, total_error) = (read("response_total"), read("response_total_error"));
    let (sd, low) = (read("response_sd"), read("response_q025"));
    for (j, t) in line::TIMES.into_iter().enumerate() {
        let variance = 1.0 + 0.25 * t * t;
        assert!((sd[j].powi(2) / variance - 1.0).abs() < ERRORS * (2.0_f64 / 10_000.0).sqrt());
        assert!((low[j] / variance.sqrt() + 1.96).abs() < ERRORS * 2.7 * 0.01, "{}", low[j]);
        for (value, error) in [(first[2 * j], error[2 * j]), (total[2 * j], total_error[2 * j])] {
            assert!((value - 1.0 / variance).abs() < ERRORS * error && error < 0.02, "{t} {value}");
        }
    }
    // Everything is kept.
    let (again, same) = run(folder.path());
    assert!(again.made.is_empty(), "{:?}", again.made);
    assert_eq!(same["quantities"], summary["quantities"]);
    let page = fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(page.contains("Propagated priors") && page.contains("response under the priors"));
}

/// The section alone asks for the response.
#[test]
fn a_section_without_quantities() {
    let folder = written("\n[forward]\ndraws = 500\n");
    let (ran, summary) = run(folder.path());
    assert!(summary.get("quantities").is_none());
    let found = ran.findings.propagated.unwrap();
    assert_eq!((found.samples, found.inputs), (500, vec!["level0".to_owned(), "rise".to_owned()]));
    assert!(run(folder.path()).0.made.is_empty());
}

/// The Ishigami function (Ishigami and Homma 1990) times a factor that grows along the axis, without a surrogate.
const ISHIGAMI: &str = r#"
[study]
title = "Ishigami"
seed = 3

[[parameter]]
name = "a"
prior = { uniform = [-3.141592653589793, 3.141592653589793] }

[[parameter]]
name = "b"
prior = { uniform = [-3.141592653589793, 3.141592653589793] }

[[parameter]]
name = "c"
prior = { uniform = [-3.141592653589793, 3.141592653589793] }

[response]
name = "y"
axes = { x = { first = 0.0, last = 1.0, count = 3 } }

[model]
use = "equations"
observe = "(1 + x) * (sin(a) + 7 * sin(b)^2 + 0.1 * c^4 * sin(a))"

[forward]
draws = 4000

[[quantity]]
name = "half"
use = "at"
place = 0.5

[[quantity]]
name = "scaled"
use = "expression"
formula = "2 * half + 1"
"#;

#[test]
fn ishigami_without_a_surrogate() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("study.toml"), ISHIGAMI).unwrap();
    let (ran, summary) = run(folder.path());
    let alone = 0.5 * (1.0 + 0.1 * PI.powi(4) / 5.0).powi(2);
    let second = 49.0 / 8.0;
    let both = 0.01 * PI.powi(8) * (1.0 / 18.0 - 1.0 / 50.0);
    let all = alone + second + both;
    for (name, scale, mean) in [("half", 1.5, 5.25), ("scaled", 3.0, 11.5)] {
        let found = &summary["quantities"][name];
        // The kurtosis of the function is 3.5.
        agrees(name, found, (mean, scale * scale * all, 3.5));
        shares(name, found, "a", [alone, alone + both, alone + 0.5 * both].map(|v| v / all), 0.04);
        shares(name, found, "b", [second / all; 3], 0.04);
        shares(name, found, "c", [0.0, both, 0.5 * both].map(|v| v / all), 0.04);
        assert_eq!(found["includes"], serde_json::json!([]));
    }
    // 4000 samples of 6 points, and the medians.
    let said =
        ran.warnings.iter().chain(&ran.notes).any(|text| text.contains("24001 runs of the model"));
    assert!(said, "{:?} {:?}", ran.warnings, ran.notes);
}

/// A straight line fitted to a parabola: the error of the emulator is in the prediction, and in its band.
#[test]
fn the_error_of_the_emulator_is_in_the_prediction() {
    let text = r#"
[study]
title = "A parabola"

[[parameter]]
name = "a"
prior = { uniform = [-1.0, 1.0] }

[response]
name = "y"
axes = { x = { first = 0.0, last = 1.0, count = 3 } }

[model]
use = "equations"
observe = "a + 0.5 * a^2 + 0 * x"

[design]
use = "latin_hypercube"
runs = 120

[surrogate]
use = "polynomial_chaos"
degree = { max = 1 }
validation = 0

[[quantity]]
name = "start"
use = "at"
place = 0
"#;
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("study.toml"), text).unwrap();
    let (ran, summary) = run(folder.path());
    let found = &summary["quantities"]["start"];
    // a² / 2 has the variance (1/5 - 1/9) / 4 = 1/45 beside 1/3; the fit to 120 runs adds some per cent to the errors.
    let (whole, alone) = (number(found, "/sd").powi(2), number(found, "/parameters/sd").powi(2));
    assert!((alone * 3.0 - 1.0).abs() < 0.05, "{alone}");
    assert!(((whole - alone) * 45.0 - 1.0).abs() < 0.35, "{}", whole - alone);
    assert!(number(found, "/without/emulator") < number(found, "/sd"));
    let bands = ran.findings.propagated.unwrap().bands;
    assert!((bands.sd[0] / number(found, "/sd") - 1.0).abs() < 0.05, "{bands:?}");
}
