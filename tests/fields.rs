//! Random fields as inputs, against closed forms: the posterior of Gaussian process regression, a heated rod whose
//! conductivity is known, and models that take a field by its places.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use lacuna_engine::report::summary_text;
use lacuna_engine::stage::simulator::Simulator;
use lacuna_engine::study::Study;
use lacuna_linalg::{Cholesky, Matrix};
use serde_json::Value;

use crate::quick;

fn run(folder: &Path) -> Value {
    let out = folder.join("out");
    quick::run(&folder.join("study.toml"), &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
    quick::summary(&out)
}

fn list(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// Solves `A x = b` for a covariance `A`.
fn solved(a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    Cholesky::new(&Matrix::from_rows(b.len(), a)).unwrap().solve(&mut b);
    b
}

const PLACES: [f64; 9] = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0];

const OBSERVED: &str = r#"
[study]
title = "A field that is measured at some of its places"
seed = 4

[[field]]
name = "f"
unit = "K"
axes = { x = { first = 0.0, last = 4000.0, count = 9, unit = "mm" } }
distribution = { normal = { mean = { path = "mean.csv", at = "x", value = "f" }, sd = 2.0 } }
kernel = "matern_3_2"
length = 800
terms = 9

[response]
name = "y"
unit = "K"
axes = { s = { values = [500, 1500, 3000], unit = "mm" } }

[model]
use = "equations"
observe = "f(s)"

[measurements]
use = "csv"
path = "y.csv"

[discrepancy]
use = "gaussian"
variance = { known = 0.25 }

[sampler]
use = "no_u_turn"

[validate]
rerun_model = false
"#;

/// Mean and variance given data are those of Gaussian process regression (Rasmussen and Williams 2006, equations 2.25 and
/// 2.26). With all terms the expansion is exact at the places. A tolerance is four Monte Carlo errors, by the smallest
/// effective sample size of a coefficient; the field is described by at most 4000 draws.
#[test]
fn a_measured_field_has_the_posterior_of_gaussian_process_regression() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("study.toml"), OBSERVED).unwrap();
    // In metres and millikelvin, to be converted.
    fs::write(folder.path().join("mean.csv"), "x [m],f [mK]\n0,10000\n4,12000\n").unwrap();
    let (at, y) = ([0.5, 1.5, 3.0], [13.0, 9.0, 12.5]);
    let mut table = "s [mm],y [K]\n".to_owned();
    (0..3).for_each(|i| writeln!(table, "{},{}", 1000.0 * at[i], y[i]).unwrap());
    fs::write(folder.path().join("y.csv"), table).unwrap();
    let summary = run(folder.path());
    let found = &summary["fields"]["f"];
    let kernel = |x: f64, y: f64| {
        let h = 3.0_f64.sqrt() * (x - y).abs() / 0.8;
        4.0 * (1.0 + h) * (-h).exp()
    };
    let mean = |x: f64| 10.0 + 0.5 * x;
    let noise = |i: usize, j: usize| if i == j { 0.25 } else { 0.0 };
    let covariance: Vec<Vec<f64>> =
        (0..3).map(|i| (0..3).map(|j| kernel(at[i], at[j]) + noise(i, j)).collect()).collect();
    let residual: Vec<f64> = (0..3).map(|i| y[i] - mean(at[i])).collect();
    let weights = solved(covariance.clone(), residual);
    let ess = |name: String| summary["parameters"][&name]["ess_bulk"].as_f64().unwrap();
    let draws = (1..=9).map(|k| ess(format!("f.term[{k}]"))).fold(4000.0, f64::min);
    let (means, sds) = (list(&found["mean"]), list(&found["sd"]));
    let [low, middle, high] = ["q025", "median", "q975"].map(|key| list(&found[key]));
    for (i, x) in PLACES.iter().enumerate() {
        let row: Vec<f64> = at.iter().map(|s| kernel(*x, *s)).collect();
        let exact = mean(*x) + row.iter().zip(&weights).map(|(k, w)| k * w).sum::<f64>();
        let explained: f64 =
            row.iter().zip(solved(covariance.clone(), row.clone())).map(|(k, w)| k * w).sum();
        let sd = (4.0 - explained).sqrt();
        let error = (means[i] - exact) / (sd / draws.sqrt());
        assert!(error.abs() < 4.0, "mean at {x}: {} for {exact}", means[i]);
        let error = (sds[i] / sd - 1.0) * (2.0 * draws).sqrt();
        assert!(error.abs() < 4.0, "sd at {x}: {} for {sd}", sds[i]);
        // The error of an outer quantile of a normal distribution is 2.7 times that of its mean, of the median 1.25 times.
        for (found, z, factor) in
            [(low[i], -1.959_964, 2.7), (middle[i], 0.0, 1.25), (high[i], 1.959_964, 2.7)]
        {
            let error = (found - exact - z * sd) / (factor * sd / draws.sqrt());
            assert!(error.abs() < 4.0, "quantile at {x}: {error}");
        }
    }
    assert_eq!(found["terms"], 9);
    assert!((found["variance"].as_f64().unwrap() - 1.0).abs() < 1e-12);
}

/// The shipped study of a rod.
fn rod() -> Study {
    quick::load(&quick::root().join("configs/rod/study.toml"), &[])
}

/// The temperature is the integral of the flux over the conductivity, here by Simpson's rule over the places, whose error is of
/// fourth order like that of the splines between them.
#[test]
fn the_temperature_of_the_rod_is_the_integral_of_flux_over_conductivity() {
    let study = rod();
    let field = &study.fields[0];
    let terms = field.terms();
    let simulator = Simulator::of(&study).unwrap().unwrap();
    let integral = |point: &[f64], last: usize| {
        let values = field.values(point);
        let slope = |i: usize| 2000.0 * (1.0 - field.at[i]) / values[i];
        let piece = |i: usize| slope(i) + 4.0 * slope(i + 1) + slope(i + 2);
        (0..last).step_by(2).map(piece).sum::<f64>() * 0.02 / 3.0
    };
    let point: Vec<f64> = (0..terms).map(|k| (1.7 * k as f64 + 0.4).sin()).collect();
    let gradient = simulator.model.gradient().unwrap();
    let (response, jacobian) =
        simulator.with_derivatives(&simulator.settings[0], gradient, &point).unwrap();
    // Outputs at 0.2, 0.4, 0.6, 0.8 and 1, and the places there.
    for (output, place) in [(3, 10), (7, 20), (11, 30), (15, 40), (19, 50)] {
        let exact = integral(&point, place);
        let error = response.values[output] / exact - 1.0;
        assert!(error.abs() < 1e-5, "place {place}: {} for {exact}", response.values[output]);
        for k in 0..terms {
            let at = |side: f64| {
                let mut moved = point.clone();
                moved[k] += 1e-4 * side;
                integral(&moved, place)
            };
            let slope = (at(1.0) - at(-1.0)) / 2e-4;
            let error = jacobian[(output, k)] - slope;
            assert!(
                error.abs() < 2e-5 * exact,
                "term {k} at {place}: {} for {slope}",
                jacobian[(output, k)]
            );
        }
    }
}

/// The data of the rod follow from a conductivity in closed form that no term of the expansion has.
#[test]
#[ignore = "takes 20 s on two cores: cargo test --workspace --test all -- --ignored --nocapture fields::the_conductivity"]
fn the_conductivity_of_the_rod_is_recovered() {
    let folder = tempfile::tempdir().unwrap();
    let study = quick::root().join("configs/rod/study.toml");
    let ran = quick::run(&study, &[], folder.path()).unwrap_or_else(|stop| panic!("{stop}"));
    println!("{}", summary_text(&ran.findings));
    let summary = quick::summary(folder.path());
    assert_eq!(summary["converged"], true, "{}", summary["verdict"]);
    let found = &summary["fields"]["conductivity"];
    let [at, mean, sd, median] = ["at", "mean", "sd", "median"].map(|key| list(&found[key]));
    let [low, high] = ["q025", "q975"].map(|key| list(&found[key]));
    let truth = |x: f64| 20.0 / (1.0 + 0.5 * (std::f64::consts::TAU * x).sin());
    let prior = 20.0 * (0.16_f64.exp() * 0.16_f64.exp_m1()).sqrt();
    let mut covered = 0;
    for i in 0..at.len() {
        println!(
            "{:.2} {:.2} [{:.2}, {:.2}] {:.2}",
            at[i],
            median[i],
            low[i],
            high[i],
            truth(at[i])
        );
        // The flux vanishes towards the end of the rod, where the data say little of the conductivity.
        assert!(at[i] > 0.7 || sd[i] < 0.25 * prior, "{}: {} of {prior}", at[i], sd[i]);
        let error = (median[i] / truth(at[i])).ln() / (sd[i] / mean[i]);
        assert!(error.abs() < 3.5, "at {}: {} for {}", at[i], median[i], truth(at[i]));
        covered += usize::from((low[i]..=high[i]).contains(&truth(at[i])));
    }
    println!("{covered} of {}", at.len());
    // Neighbouring places are one error: the curve may leave its band somewhere, and is not outside everywhere.
    assert!(covered >= 40, "{covered} of {}", at.len());
    let middle = &summary["parameters"]["middle"];
    assert_eq!(middle["role"], "derived");
    assert!((middle["mean"].as_f64().unwrap() / mean[25] - 1.0).abs() < 0.01);
}

const SHARED: &str = r#"
[study]
title = "A field by its places"

[[parameter]]
name = "gain"
prior = { uniform = [1.0, 2.0] }

[[field]]
name = "k"
unit = "m"
axes = { x = { values = [0.0, 0.3, 1.0] } }
distribution = { log_normal = { median = 2.0, sd = 0.5 } }
kernel = "exponential"
length = 0.4
terms = 2

[response]
name = "y"
unit = "mm"
axes = { x = { values = [0.0, 0.3, 1.0] } }
"#;

const BY_FUNCTION: &str = "\n[model]\nuse = \"equations\"\nobserve = \"gain * k(x)\"\n";
const BY_PLACES: &str = "\n[model]\nuse = \"python\"\nfile = \"model.py\"\ngradient = \"slopes\"\nunits = { \"k[1]\" = \"mm\", \"k[2]\" = \"mm\", \"k[3]\" = \"mm\" }\n";
const FORWARD: &str = "\n[forward]\ndraws = 1000\n";
const MODEL: &str = "
def simulate(gain, k):
    return [gain * value for value in k]


def slopes(gain, k):
    unit = [[gain if i == j else 0.0 for j in range(3)] for i in range(3)]
    return {'gain': list(k), 'k': unit}
";

/// A function that takes the values at the places gives what equations give that call the field, and the derivatives by the
/// coefficients follow from those by the values.
#[test]
fn a_field_by_its_places_is_that_of_equations() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("model.py"), MODEL).unwrap();
    let point = [1.5, 0.3, -1.2];
    let mut found = Vec::new();
    for (name, model) in [("function", BY_FUNCTION), ("places", BY_PLACES)] {
        let path = folder.path().join(format!("{name}.toml"));
        fs::write(&path, [SHARED, model, FORWARD].concat()).unwrap();
        let study = quick::load(&path, &[]);
        let names: Vec<&str> = study.parameters.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["gain", "k.term[1]", "k.term[2]"]);
        let simulator = Simulator::of(&study).unwrap().unwrap();
        let gradient = simulator.model.gradient().unwrap();
        let both = simulator.with_derivatives(&simulator.settings[0], gradient, &point);
        found.push(both.unwrap());
    }
    let (response, jacobian) = &found[0];
    let (other, slopes) = &found[1];
    // The model of places answers in the unit of the response, millimetres.
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs().max(1e-3);
    for (a, b) in response.values.iter().zip(&other.values) {
        assert!(near(*a, *b), "{a} {b}");
    }
    for (a, b) in jacobian.as_slice().iter().zip(slopes.as_slice()) {
        assert!(near(*a, *b), "{a} {b}");
    }
}
