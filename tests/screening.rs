//! Screening of the inputs of a study by its runs.

use std::fs;

use lacuna_engine::report::summary_text;
use serde_json::Value;

use crate::quick;

/// A linear input, a product of two, and one that hardly acts.
const STUDY: &str = r#"
[study]
title = "screening"
seed = 4

[[parameter]]
name = "a"
prior = { uniform = [1.0, 2.0] }

[[parameter]]
name = "b"
prior = { uniform = [-1.0, 1.0] }

[[parameter]]
name = "c"
prior = { uniform = [-1.0, 1.0] }

[[parameter]]
name = "d"
prior = { uniform = [0.0, 10.0] }

[response]
name = "y"
axes = { t = { first = 1.0, last = 2.0, count = 3, unit = "1" } }

[model]
use = "equations"
observe = "t * (2 * a + 4 * b * c + 1e-4 * d)"

[design]
use = "morris"
runs = 40

[surrogate]
use = "polynomial_chaos"
degree = 2

[forward]
draws = 200
"#;

fn screened(settings: &[&str]) -> (Value, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.toml");
    fs::write(&path, STUDY).unwrap();
    let out = folder.path().join("out");
    let ran = quick::run(&path, settings, &out).unwrap_or_else(|stop| panic!("{stop}"));
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("The runs show no effect of"));
    (quick::summary(&out)["runs"]["screening"].clone(), summary_text(&ran.findings))
}

/// Along trajectories a linear input has one elementary effect, `2` for `a` and `1e-3` for `d` over their ranges, in
/// the same unknown unit; a product has scattered ones.
#[test]
fn trajectories_give_elementary_effects() {
    let (found, text) = screened(&[]);
    let number = |input: &str, key: &str| found[input][key].as_f64().unwrap();
    let ratio = number("a", "mu_star") / number("d", "mu_star");
    assert!((ratio / 2000.0 - 1.0).abs() < 1e-6, "{found}");
    assert!(number("a", "sigma") < 1e-6 * number("a", "mu_star"), "{found}");
    assert!(number("b", "sigma") > 0.3 * number("b", "mu_star"), "{found}");
    assert!(found["a"].get("p").is_none());
    let acts = ["a", "b", "c", "d"].map(|input| found[input]["acts"] == true);
    assert_eq!(acts, [true, true, true, false]);
    assert!(text.contains("The runs show no effect of `d` (mu* ="), "{text}");
}

/// Other runs give a test of independence.
#[test]
fn other_runs_give_a_test_of_independence() {
    let (found, text) = screened(&["design.use=latin_hypercube", "design.runs=150"]);
    let p = |input: &str| found[input]["p"].as_f64().unwrap();
    assert!(p("a") < 1e-3 && p("b") < 0.05 && p("c") < 0.05 && p("d") > 0.05, "{found}");
    assert!(found["a"]["hsic"].as_f64().unwrap() > found["d"]["hsic"].as_f64().unwrap());
    assert!(found["a"].get("mu_star").is_none());
    assert!(text.contains("The runs show no effect of `d` (p ="), "{text}");
}
