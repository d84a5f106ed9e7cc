//! Populations of unknowns besides the parameters: of a discrepancy and of effects.
//!
//! Eight schools again, whose effects are offsets of the response and no inputs of the model; and variances of six groups against
//! quadrature.

use std::fmt::Write as _;
use std::fs;

use generator::noise::Source;
use lacuna::math::moments;

use super::{ERRORS, draws, has_the_reference, number, run, schools_of};
use crate::quick;

const SCHOOLS_STUDY: &str = r#"
[study]
name = "schools"
title = "Offsets of the scores in eight schools"
seed = 1982

[[parameter]]
name = "level"
prior = { normal = [0.0, 1e-6] }

[response]
name = "score"

[model]
use = "equations"
observe = "level"

[measurements]
use = "csv"
path = "schools.csv"
groups = "school"

[[effect]]
use = "offset"
by = "school"
size = { normal = [0.0, 5.0] }
population = { size = { normal = { sd = { half_student_t = [1.0, 5.0] } } } }

[discrepancy]
use = "gaussian"
variance = { measured = { known = 1 } }   # the stated errors

[sampler]
use = "no_u_turn"
target_acceptance = 0.95
"#;

#[test]
fn eight_schools_as_offsets_have_their_published_posterior() {
    let folder = schools_of(SCHOOLS_STUDY);
    run(folder.path(), &[]);
    let summary = quick::summary(&folder.path().join("out"));
    has_the_reference(&summary, &|school| format!("offset[{school}].size"), "offset.size");
    let population = &summary["populations"]["offset.size"];
    assert_eq!(population["form"], "normal");
    let pooling = number(population, "/members/offset[A].size/pooling");
    assert!((0.7..0.95).contains(&pooling), "{pooling}");
}

const VARIANCES_STUDY: &str = r#"
[study]
name = "variances"
title = "Noise of six gauges"
seed = 11

[[parameter]]
name = "level"
prior = { normal = [2.0, 1e-6] }

[response]
name = "strain"
axes = { sensor = { labels = ["A", "B", "C", "D", "E", "F"] }, t = { first = 1.0, last = 5.0, count = 5, unit = "s" } }

[model]
use = "equations"
observe = { A = "level", B = "level", C = "level", D = "level", E = "level", F = "level" }

[measurements]
use = "csv"
path = "strain.csv"

[discrepancy]
use = "gaussian"
by = "sensor"
replicate_error = false
variance = { log_uniform = [1e-3, 1.0] }
population = { variance = { log_normal = { sd = { half_normal = 1.0 } } } }

[sampler]
use = "no_u_turn"
steps = 1500
warm_up = 500
"#;

/// Values of each gauge: of four only five are there.
const COUNTS: [usize; 6] = [5, 5, 5, 5, 20, 40];

/// Table of the gauges, and the sum of the squared errors of each. The standard deviations of the noise are no draws of a
/// log-normal law.
fn gauges() -> (String, [f64; 6]) {
    let mut random = Source::new(3);
    let mut table = "replicate,sensor,t [s],strain\n".to_owned();
    let mut squares = [0.0; 6];
    for (k, (name, sd)) in "ABCDEF".chars().zip([0.1, 0.1, 0.15, 0.6, 0.12, 0.2]).enumerate() {
        for i in 0..COUNTS[k] {
            let error = sd * random.normal();
            squares[k] += error * error;
            writeln!(table, "{},{name},{},{}", i / 5, i % 5 + 1, 2.0 + error).unwrap();
        }
    }
    (table, squares)
}

/// Posterior means and standard deviations of the logarithms of the six variances and of the median of their population, and of its
/// sd, by the trapezoidal rule: `p(m) p(s) ∏ ∫ N(u | ln m, s) exp(-n u / 2 - S exp(-u) / 2) du` with `u` the logarithm of a variance.
fn quadrature(squares: &[f64; 6]) -> Vec<(f64, f64)> {
    const STEP: f64 = 0.04;
    let grid: Vec<f64> = (0..=400).map(|i| -12.0 + STEP * f64::from(i)).collect();
    let density = |k: usize, u: f64| {
        let n = COUNTS[k] as f64;
        (-0.5 * n * (u - (squares[k] / n).ln()) - 0.5 * squares[k] * (-u).exp() + 0.5 * n).exp()
    };
    let own: Vec<Vec<f64>> =
        (0..6).map(|k| grid.iter().map(|&u| density(k, u)).collect()).collect();
    let mut sums = [[0.0; 3]; 8];
    let mut total = 0.0;
    for i in 0..=100 {
        let location = 1e-3_f64.ln() * (1.0 - f64::from(i) / 100.0);
        for j in 1..=160 {
            let sd = 0.025 * f64::from(j);
            let law: Vec<f64> =
                grid.iter().map(|u| (-0.5 * ((u - location) / sd).powi(2)).exp() / sd).collect();
            let each = |k: usize| {
                let all = grid.iter().zip(&law).zip(&own[k]);
                all.fold([0.0; 3], |[zero, one, two], ((u, law), own)| {
                    let weight = law * own;
                    [zero + weight, one + weight * u, two + weight * u * u]
                })
            };
            let each: Vec<[f64; 3]> = (0..6).map(each).collect();
            let ends = if i == 0 || i == 100 { 0.5 } else { 1.0 };
            let prior = ends * (-0.5 * sd * sd).exp();
            let weight = prior * each.iter().map(|[zero, ..]| zero).product::<f64>();
            if weight == 0.0 {
                continue;
            }
            total += weight;
            for (sums, [zero, one, two]) in sums.iter_mut().zip(&each) {
                sums[1] += weight * one / zero;
                sums[2] += weight * two / zero;
            }
            for (sums, x) in sums[6..].iter_mut().zip([location, sd]) {
                sums[1] += weight * x;
                sums[2] += weight * x * x;
            }
        }
    }
    let moments = |[_, one, two]: &[f64; 3]| {
        let mean = one / total;
        (mean, (two / total - mean * mean).sqrt())
    };
    sums.iter().map(moments).collect()
}

#[test]
fn variances_of_gauges_inform_each_other_as_quadrature_says() {
    let folder = tempfile::tempdir().unwrap();
    let (table, squares) = gauges();
    fs::write(folder.path().join("strain.csv"), table).unwrap();
    fs::write(folder.path().join("study.toml"), VARIANCES_STUDY).unwrap();
    let ran = run(folder.path(), &[]);
    let summary = quick::summary(&folder.path().join("out"));
    let names = "ABCDEF".chars().map(|name| format!("variance[{name}]"));
    let names: Vec<String> =
        names.chain(["variance.median".to_owned(), "variance.sd".to_owned()]).collect();
    let all = draws(&ran, &names.iter().map(String::as_str).collect::<Vec<_>>());
    for (k, (name, (mean, sd))) in names.iter().zip(quadrature(&squares)).enumerate() {
        let linear = |x: f64| if k < 7 { x.ln() } else { x };
        let values: Vec<f64> = all.iter().map(|point| linear(point[k])).collect();
        let effective = number(&summary["parameters"][name], "/ess_bulk").min(values.len() as f64);
        let off = moments::mean(&values) - mean;
        assert!(off.abs() < ERRORS * sd / effective.sqrt(), "{name}: off by {off}, sd {sd}");
        let ratio = moments::variance(&values).sqrt() / sd;
        // Skewed distributions: the error of a standard deviation is up to twice that of a normal one.
        assert!((ratio - 1.0).abs() < 2.0 * ERRORS / (2.0 * effective).sqrt(), "{name}: {ratio}");
    }
    let pooling = |name: char| {
        number(&summary, &format!("/populations/variance/members/variance[{name}]/pooling"))
    };
    assert!(pooling('A') > 2.0 * pooling('F'), "{} {}", pooling('A'), pooling('F'));
}

#[test]
fn populations_that_cannot_be_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("strain.csv"), gauges().0).unwrap();
    let said = |study: String| {
        let path = folder.path().join("study.toml");
        fs::write(&path, study).unwrap();
        let out = tempfile::tempdir().unwrap();
        match quick::run(&path, &[], &out.path().join("run")) {
            Ok(_) => panic!("it ran"),
            Err(stop) => stop.to_string(),
        }
    };
    // A name that is almost an option is told before anything is computed, with its line.
    let path = folder.path().join("study.toml");
    fs::write(&path, VARIANCES_STUDY.replace("{ variance = {", "{ varience = {")).unwrap();
    let checked = lacuna_engine::study::resolve::load(&path, &[]).complaints();
    assert!(
        checked.contains("study.toml:") && checked.contains("no unknown `varience`"),
        "{checked}"
    );
    assert!(checked.contains("did you mean `variance`?"), "{checked}");
    let unknown = said(VARIANCES_STUDY.replace("{ variance = {", "{ stiffness = {"));
    assert!(unknown.contains("`stiffness`, which is none of its unknowns"), "{unknown}");
    let alone = said(VARIANCES_STUDY.replace("by = \"sensor\"\n", ""));
    assert!(alone.contains("not two groups with data") && alone.contains("add `by`"), "{alone}");
    let normal = said(VARIANCES_STUDY.replace("log_normal = {", "normal = {"));
    assert!(normal.contains("above zero") && normal.contains("log_normal"), "{normal}");
}
