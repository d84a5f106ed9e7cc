//! Predicted quantities against closed forms: straight lines with normal noise, whose posterior is known exactly.
//!
//! A tolerance is a multiple of the Monte Carlo error: of the mean as printed (`mcse_mean`), and of a standard deviation
//! `sd / √(2 n)` with the effective number of draws `n = (sd / mcse_mean)²`.

mod fatigue;
mod mixture;

use std::f64::consts::{PI, SQRT_2};
use std::fs;
use std::path::Path;

use generator::{line, noise};
use serde_json::Value;
use tempfile::TempDir;

use crate::quick;

const SD: f64 = 0.5;

/// Multiple of the Monte Carlo error: exceeded with a probability of 6e-5 per figure.
const ERRORS: f64 = 4.0;

/// All errors of a new replicate.
const ALL: &str = "include = [\"emulator\", \"numerics\", \"model_form\", \"measurement\"]";

fn section(name: &str, plugin: &str, more: &str) -> String {
    format!("\n[[quantity]]\nname = \"{name}\"\nuse = \"{plugin}\"\n{more}\n")
}

/// The study of a line with these quantities, and its exact posterior.
fn written(quantities: &str) -> (TempDir, line::Posterior) {
    let mut random = noise::Source::new(5);
    let data = line::replicates([0.7, -0.4], SD, 4, &mut random);
    let folder = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(quick::root().join("tests/gate/study.toml")).unwrap();
    fs::write(folder.path().join("study.toml"), text + quantities).unwrap();
    fs::write(folder.path().join("line.csv"), line::table(&data)).unwrap();
    let [runs, responses] = line::runs(40, &mut random);
    fs::write(folder.path().join("runs.csv"), runs).unwrap();
    fs::write(folder.path().join("responses.csv"), responses).unwrap();
    (folder, line::posterior(&data, SD))
}

fn run(folder: &Path, settings: &[&str]) -> quick::Ran {
    let ran = quick::run(&folder.join("study.toml"), settings, &folder.join("out"));
    ran.unwrap_or_else(|stop| panic!("{stop}"))
}

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("no {pointer}"))
}

/// Mean and variance of `w · response`, without noise.
fn linear(exact: &line::Posterior, weights: &[f64; 6]) -> (f64, f64) {
    let level: f64 = weights.iter().sum();
    let rise: f64 = weights.iter().zip(line::TIMES).map(|(w, t)| w * t).sum();
    let [[a, b], [_, c]] = exact.covariance;
    let mean = level * exact.mean[0] + rise * exact.mean[1];
    (mean, level * level * a + 2.0 * level * rise * b + rise * rise * c)
}

/// Requires the mean and the standard deviation of a prediction.
fn agrees(what: &str, found: &Value, mean: f64, sd: f64) {
    let error = number(found, "/mcse_mean");
    let draws = (number(found, "/sd") / error).powi(2);
    let off = number(found, "/mean") - mean;
    assert!(off.abs() < ERRORS * error, "{what}: mean off by {off}, error {error}");
    let ratio = number(found, "/sd") / sd;
    assert!(
        (ratio - 1.0).abs() < ERRORS / (2.0 * draws).sqrt(),
        "{what}: sd ratio {ratio}, {draws}"
    );
}

/// Linear functionals are normal: with the noise of each value independent, the variance of `w · y` is that of the line
/// and `Σ w²` times that of the noise.
#[test]
fn linear_quantities_have_their_normal_distribution() {
    let middle = [0.0, 0.0, 0.5, 0.5, 0.0, 0.0];
    let whole = [0.5, 1.0, 1.0, 1.0, 1.0, 0.5];
    let late = [0.0, 0.0, 0.0, 0.5, 1.0, 0.5];
    let window = "window = [{ value = 4000, unit = \"ms\" }, 6]";
    let text = [
        section("middle", "at", &format!("place = 3.5\n{ALL}")),
        section("impulse", "integral", ALL),
        section("late", "integral", &format!("{window}\nunit = \"cm s\"\n{ALL}")),
        section("true_middle", "at", "place = 3.5\nreference = 1"),
        section("twice", "expression", "formula = \"2 * middle + 0 {s} * rise\""),
    ];
    let (folder, exact) = written(&text.concat());
    run(folder.path(), &[]);
    let summary = quick::summary(&folder.path().join("out"));
    let found = |name: &str| summary["quantities"][name].clone();
    for (name, weights, scale) in
        [("middle", middle, 1.0), ("impulse", whole, 1.0), ("late", late, 100.0)]
    {
        let (mean, variance) = linear(&exact, &weights);
        let noise = SD * SD * weights.iter().map(|w| w * w).sum::<f64>();
        let all = found(name);
        agrees(name, &all, scale * mean, scale * (variance + noise).sqrt());
        let sd = scale * (variance + noise).sqrt();
        let error = number(&all, "/mcse_mean");
        // The error of an outer quantile of a normal distribution is 2.7 times that of its mean, of the median 1.25 times.
        for (key, z, factor) in
            [("q025", -1.959_964, 2.7), ("median", 0.0, 1.25), ("q975", 1.959_964, 2.7)]
        {
            let off = number(&all, &format!("/{key}")) - scale * mean - z * sd;
            assert!(off.abs() < ERRORS * factor * error, "{name} {key}: {off} {error}");
        }
        // The draws of the parameters alone, whose error is that of the parameters.
        let draws = (number(&all, "/sd") / error).powi(2);
        let alone = number(&all, "/parameters/sd") / (scale * variance.sqrt());
        assert!((alone - 1.0).abs() < ERRORS / (0.5 * draws).sqrt(), "{name}: {alone}");
        for key in ["q025", "median", "q975"] {
            let z = ["q025", "median", "q975"].iter().position(|k| *k == key).unwrap() as f64 - 1.0;
            let end = scale * (mean + 1.959_964 * z * variance.sqrt());
            let off = number(&all, &format!("/parameters/{key}")) - end;
            assert!(off.abs() < 2.7 * ERRORS * error, "{name} {key}: {off} {error}");
        }
        // Without the parameters only the noise is left.
        let fixed = number(&all, "/without/parameters") / (scale * noise.sqrt());
        assert!((fixed - 1.0).abs() < ERRORS / 2000.0_f64.sqrt(), "{name}: {fixed}");
        // The parts of the noise are those of `spread`.
        let left = 1.0 - (number(&summary, "/spread/measurement") / SD).powi(2);
        let without = (variance + left * noise).sqrt();
        let ratio = number(&all, "/without/measurement") / (scale * without);
        assert!((ratio - 1.0).abs() < ERRORS / (0.5 * draws).sqrt(), "{name}: {ratio}");
    }
    // The true response: without the scatter of a replicate.
    let truly = found("true_middle");
    let form = number(&summary, "/spread/model_form").powi(2);
    let (mean, variance) = linear(&exact, &middle);
    agrees("true_middle", &truly, mean, (variance + 0.5 * form).sqrt());
    assert_eq!(truly["leaves_out"], serde_json::json!(["measurement"]));
    assert_eq!((number(&truly, "/reference"), number(&truly, "/undefined")), (1.0, 0.0));
    // An expression has the draws of the quantities that it uses.
    let (twice, once) = (found("twice"), found("middle"));
    for key in ["/mean", "/sd", "/q025", "/parameters/mean", "/map"] {
        assert!((number(&twice, key) - 2.0 * number(&once, key)).abs() < 1e-9, "{key}");
    }
    assert_eq!((&once["unit"], &found("late")["unit"]), (&"m".into(), &"cm s".into()));
}

/// Standard normal density and distribution function.
fn density(x: f64) -> f64 {
    (-0.5 * x * x).exp() / (2.0 * PI).sqrt()
}

/// The series of the distribution function, for arguments of order one.
fn distribution(x: f64) -> f64 {
    let (mut term, mut sum) = (x, x);
    for n in 1..200 {
        term *= x * x / f64::from(2 * n + 1);
        sum += term;
    }
    0.5 + density(x) * sum
}

/// The maximum of two normal values, whose moments are those of Clark, Operations Research 9 (1961) 145.
#[test]
fn the_maximum_of_two_values_has_its_moments() {
    let text = section("peak", "maximum", &format!("window = [1, 2]\n{ALL}"));
    let (folder, exact) = written(&text);
    run(folder.path(), &[]);
    let first = linear(&exact, &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let second = linear(&exact, &[0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    let both = linear(&exact, &[1.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    let covariance = 0.5 * (both.1 - first.1 - second.1);
    let [v, w] = [first.1 + SD * SD, second.1 + SD * SD];
    let spread = (v + w - 2.0 * covariance).sqrt();
    let alpha = (first.0 - second.0) / spread;
    let (p, q) = (distribution(alpha), distribution(-alpha));
    let mean = first.0 * p + second.0 * q + spread * density(alpha);
    let square = (first.0.powi(2) + v) * p
        + (second.0.powi(2) + w) * q
        + (first.0 + second.0) * spread * density(alpha);
    let summary = quick::summary(&folder.path().join("out"));
    agrees("peak", &summary["quantities"]["peak"], mean, (square - mean * mean).sqrt());
    // The noise raises the maximum above that of the mean curve.
    let found = &summary["quantities"]["peak"];
    assert!(number(found, "/mean") > number(found, "/map") + SD / SQRT_2 / 4.0);
}

#[test]
fn an_unchanged_study_is_reused_and_a_changed_quantity_recomputes_its_stage_alone() {
    let text = section("peak", "maximum", "")
        + &section("inverse", "expression", "formula = \"sqrt(peak - peak - 1 {m})\"");
    let (folder, _) = written(&text);
    let first = run(folder.path(), &[]);
    assert!(first.made.contains(&"6-quantities".to_owned()));
    let undefined = first.warnings.iter().find(|text| text.contains("`inverse` is undefined"));
    assert!(undefined.is_some(), "{:?}", first.warnings);
    let before = quick::results(&folder.path().join("out"));
    let again = run(folder.path(), &[]);
    assert!(again.made.is_empty(), "{:?}", again.made);
    // The same bits on another number of threads, from nothing.
    fs::remove_dir_all(folder.path().join("out")).unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    pool.install(|| run(folder.path(), &[]));
    assert_eq!(quick::results(&folder.path().join("out")), before);
    quick::replace(&folder.path().join("study.toml"), "use = \"maximum\"", "use = \"range\"");
    let changed = run(folder.path(), &[]);
    assert_eq!(changed.made, ["6-quantities"]);
}

/// Records of different lengths, without a surrogate: each scenario has values of its own, and an expression of them too.
#[test]
fn scenarios_have_values_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let asked = "quantity=[{ name = 'last', use = 'maximum', window = [1.0, 9.0] }, \
                 { name = 'double', use = 'expression', formula = '2 * last + 0 {s} * speed' }, \
                 { name = 'one', use = 'mean', on = { scenario = ['steep'] } }, \
                 { name = 'pull', use = 'expression', formula = 'gravity / 2' }]";
    let study = quick::root().join("configs/records/study.toml");
    let ran = quick::run(&study, &[asked], &folder.path().join("out"));
    ran.unwrap_or_else(|stop| panic!("{stop}"));
    let summary = quick::summary(&folder.path().join("out"));
    let found = summary["quantities"].as_object().unwrap();
    let names: Vec<&str> = found.keys().map(String::as_str).collect();
    let mut expected = vec!["last[gentle]", "last[middle]", "last[steep]", "one[steep]"];
    expected.extend(["double[gentle]", "double[middle]", "double[steep]", "pull"]);
    expected.sort_unstable();
    assert_eq!(
        {
            let mut names = names;
            names.sort_unstable();
            names
        },
        expected
    );
    for scenario in ["gentle", "middle", "steep"] {
        let of = |name: &str| number(&found[&format!("{name}[{scenario}]")], "/q975");
        assert!((of("double") - 2.0 * of("last")).abs() < 1e-12 * of("last"), "{scenario}");
    }
    // One record each: measurement and model form cannot be separated, and nothing is added.
    assert_eq!(found["last[steep]"]["leaves_out"], serde_json::json!(["discrepancy"]));
    assert_eq!(found["last[steep]"]["sd"], found["last[steep]"]["parameters"]["sd"]);
}

/// The targets have no response: quantities are functions of the parameters.
#[test]
fn a_target_has_quantities_of_its_parameters() {
    let folder = tempfile::tempdir().unwrap();
    fs::copy(
        quick::root().join("configs/target/regression.toml"),
        folder.path().join("study.toml"),
    )
    .unwrap();
    let path = folder.path().join("study.toml");
    let mut text = fs::read_to_string(&path).unwrap();
    let name = quick::load(&path, &[]).parameters[0].name.clone();
    text += &section("double", "expression", &format!("formula = \"2 * {name}\""));
    fs::write(&path, text).unwrap();
    run(folder.path(), &[]);
    let summary = quick::summary(&folder.path().join("out"));
    let (found, own) = (&summary["quantities"]["double"], &summary["parameters"][&name]);
    let error = 2.0 * number(own, "/mcse_mean") + number(found, "/mcse_mean");
    let off = number(found, "/mean") - 2.0 * number(own, "/mean");
    assert!(off.abs() < ERRORS * error, "{off} {error}");
    assert_eq!(number(found, "/map"), 2.0 * number(own, "/map"));
}
