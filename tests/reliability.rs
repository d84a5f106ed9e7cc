//! Probabilities of rare events against closed forms: straight lines with normal noise, whose posterior is normal.

use std::fs;
use std::path::Path;

use generator::{line, noise};
use lacuna::math::special::normal_cdf;
use serde_json::Value;
use tempfile::TempDir;

use crate::quick;

const SD: f64 = 0.5;
const QUANTITY: &str = "\n[[quantity]]\nname = \"middle\"\nuse = \"at\"\nplace = 3.5\n";

fn written(sections: &str) -> (TempDir, line::Posterior) {
    let mut random = noise::Source::new(5);
    let data = line::replicates([0.7, -0.4], SD, 4, &mut random);
    let folder = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(quick::root().join("tests/gate/study.toml")).unwrap();
    fs::write(folder.path().join("study.toml"), text + QUANTITY + sections).unwrap();
    fs::write(folder.path().join("line.csv"), line::table(&data)).unwrap();
    let [runs, responses] = line::runs(40, &mut random);
    fs::write(folder.path().join("runs.csv"), runs).unwrap();
    fs::write(folder.path().join("responses.csv"), responses).unwrap();
    (folder, line::posterior(&data, SD))
}

fn summary(folder: &Path) -> Value {
    let ran = quick::run(&folder.join("study.toml"), &[], &folder.join("out"));
    ran.unwrap_or_else(|stop| panic!("{stop}"));
    quick::summary(&folder.join("out"))
}

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("no {pointer}"))
}

fn section(name: &str, method: &str, more: &str) -> String {
    format!(
        "\n[[reliability]]\nname = \"{name}\"\nquantity = \"middle\"\nuse = \"{method}\"\n{more}\n"
    )
}

/// Mean and standard deviation of the quantity under the posterior.
fn middle(exact: &line::Posterior) -> (f64, f64) {
    let [[a, b], [_, c]] = exact.covariance;
    let mean = exact.mean[0] + 3.5 * exact.mean[1];
    (mean, (a + 2.0 * 3.5 * b + 3.5 * 3.5 * c).sqrt())
}

/// The quantity is normal: beyond four standard deviations of the posterior lie 3.2e-5, above and below.
#[test]
fn a_tail_of_the_posterior_has_its_probability() {
    let (_, exact) = written("");
    let (mean, sd) = middle(&exact);
    let (high, low) = (mean + 4.0 * sd, 100.0 * (mean - 4.0 * sd));
    let sections = [
        section("high", "subset_simulation", &format!("above = {high}\nsamples = 4000")),
        section("low", "active_kriging", &format!("below = {{ value = {low}, unit = \"cm\" }}")),
    ];
    let (folder, _) = written(&sections.concat());
    let found = summary(folder.path());
    for name in ["high", "low"] {
        let event = &found["reliability"][name];
        let ratio = number(event, "/probability") / normal_cdf(-4.0);
        // The errors of the emulator are of the order of rounding; those of the sampling are stated.
        assert!((ratio - 1.0).abs() < 4.0 * number(event, "/variation"), "{name} {ratio} {event}");
        let [low, high] = [0, 1].map(|i| number(event, &format!("/interval/{i}")));
        assert!(low < normal_cdf(-4.0) && normal_cdf(-4.0) < high, "{name} {event}");
        assert_eq!(event["distribution"], "posterior");
    }
    assert!(number(&found, "/reliability/low/calls") < 60.0);
}

/// Under the priors `N(0, 1)` and `N(0, 0.5)` the quantity has the variance `1 + (3.5 / 2)²`.
#[test]
fn a_tail_of_the_prior_has_its_index_and_its_design_point() {
    let variance = 1.0 + 3.5 * 3.5 * 0.25;
    let more = "above = 9.0\ndistribution = \"prior\"";
    let (folder, _) = written(&section("far", "form", more));
    let found = summary(folder.path());
    let event = &found["reliability"]["far"];
    let index = 9.0 / f64::sqrt(variance);
    assert!((number(event, "/index") - index).abs() < 1e-4, "{event}");
    assert!((number(event, "/probability") / normal_cdf(-index) - 1.0).abs() < 1e-3, "{event}");
    let point = &event["design_points"][0];
    assert!((number(point, "/importance/level0") - 1.0 / variance).abs() < 1e-3, "{event}");
    // The point is at four standard deviations of the slope, beyond all of the 40 runs.
    assert!(event["warnings"].to_string().contains("beyond the simulation runs"), "{event}");
    let rise = index * (1.0 - 1.0 / variance).sqrt() * 0.5;
    assert!((number(point, "/values/rise") - rise).abs() < 1e-2, "{event}");
}
