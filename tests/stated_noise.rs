//! Measurements that state their noise, from the table to the posterior: generalised least squares in closed form.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use lacuna::math::random::{Stream, normal};
use lacuna_linalg::{Cholesky, Matrix};

use crate::quick;

/// A straight line `a + b t` at ten times as the model, with normal priors of standard deviation 3.
const STUDY: &str = "\
[study]
name = \"line\"
title = \"A line\"

[[parameter]]
name = \"a\"
prior = { normal = [0.0, 3.0] }

[[parameter]]
name = \"b\"
unit = \"1/s\"
prior = { normal = [0.0, 3.0] }

[response]
name = \"y\"
axes = { time = { first = 0.1, last = 1.0, count = 10, unit = \"s\" } }

[model]
use = \"equations\"
observe = \"a + b * time\"

[measurements]
use = \"csv\"
path = \"y.csv\"

[discrepancy]
use = \"gaussian\"
variance = { measured = { known = 1 } }

[sampler]
use = \"no_u_turn\"
warm_up = 300
steps = 2500
";

const TIMES: usize = 10;

fn time(i: usize) -> f64 {
    0.1 * (i + 1) as f64
}

/// Posterior mean and standard deviation of `a` and `b`: the precision is `X'S^-1 X + I / 9`, with `S` the covariance
/// of the values.
fn closed_form(y: &[f64], covariance: &Matrix) -> ([f64; 2], [f64; 2]) {
    let white = Cholesky::new(covariance).unwrap();
    let x = white.whiten_matrix(&Matrix::from_fn(
        y.len(),
        2,
        |i, j| if j == 0 { 1.0 } else { time(i) },
    ));
    let mut z = y.to_vec();
    white.whiten(&mut z);
    let mut precision = lacuna_linalg::gram(&x);
    (0..2).for_each(|j| precision[(j, j)] += 1.0 / 9.0);
    let precision = Cholesky::new(&precision).unwrap();
    let mut mean = lacuna_linalg::transposed_multiply_vector(&x, &z);
    precision.solve(&mut mean);
    let inverse = precision.inverse();
    ([mean[0], mean[1]], [0, 1].map(|j| inverse[(j, j)].sqrt()))
}

/// Checks the posterior of a study in a folder: the mean to four Monte Carlo errors of 2000 effective draws, the
/// standard deviation to four of its own.
fn has(folder: &Path, settings: &[&str], (mean, sd): ([f64; 2], [f64; 2])) {
    let out = folder.join("run");
    quick::run(&folder.join("study.toml"), settings, &out).unwrap_or_else(|stop| panic!("{stop}"));
    let summary = quick::summary(&out);
    for (j, name) in ["a", "b"].into_iter().enumerate() {
        let found = |key: &str| summary["parameters"][name][key].as_f64().unwrap();
        let draws = found("ess_bulk").min(found("ess_tail"));
        assert!(draws > 400.0, "{name}: {draws} effective draws");
        let error = 4.0 / draws.sqrt();
        assert!(
            (found("mean") - mean[j]).abs() < error * sd[j],
            "{name}: {} {}",
            found("mean"),
            mean[j]
        );
        assert!((found("sd") / sd[j] - 1.0).abs() < error, "{name}: {} {}", found("sd"), sd[j]);
    }
}

/// Values around `1 + 2 t` with this noise.
fn made(noise: &Matrix, seed: u64) -> Vec<f64> {
    let mut rng = Stream::root(seed).generator();
    let z: Vec<f64> = (0..TIMES).map(|_| normal(&mut rng)).collect();
    let e = Cholesky::new(noise).unwrap().colour(&z);
    (0..TIMES).map(|i| 1.0 + 2.0 * time(i) + e[i]).collect()
}

fn study(table: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("study.toml"), STUDY).unwrap();
    fs::write(folder.path().join("y.csv"), table).unwrap();
    folder
}

#[test]
fn a_column_sigma_weighs_the_values() {
    let sd = |i: usize| if i < 5 { 0.02 } else { 0.5 };
    let noise = Matrix::from_fn(TIMES, TIMES, |i, j| if i == j { sd(i) * sd(i) } else { 0.0 });
    let y = made(&noise, 1);
    let mut table = "time [s],y,sigma\n".to_owned();
    for (i, y) in y.iter().enumerate() {
        writeln!(table, "{},{y:.6},{}", time(i), sd(i)).unwrap();
    }
    let folder = study(&table);
    has(folder.path(), &[], closed_form(&y, &noise));
    // Known noise in addition to the stated noise.
    let added =
        Matrix::from_fn(TIMES, TIMES, |i, j| noise[(i, j)] + if i == j { 0.04 } else { 0.0 });
    has(folder.path(), &["discrepancy.variance={ known = 0.04 }"], closed_form(&y, &added));
    // Three of the values removed by a mask.
    let kept: Vec<usize> = (0..TIMES).filter(|i| ![2, 3, 7].contains(i)).collect();
    let mask: String =
        (0..TIMES).map(|i| format!("{},{}\n", time(i), u8::from(!kept.contains(&i)))).collect();
    fs::write(folder.path().join("mask.csv"), format!("time [s],mask\n{mask}")).unwrap();
    let wide = Matrix::from_fn(TIMES, TIMES, |i, j| {
        // A value without weight is equivalent to a missing one.
        noise[(i, j)] + if i == j && !kept.contains(&i) { 1e12 } else { 0.0 }
    });
    has(folder.path(), &["measurements.mask=mask.csv"], closed_form(&y, &wide));
}

#[test]
fn a_covariance_of_the_curve_is_used_whole() {
    let noise = Matrix::from_fn(TIMES, TIMES, |i, j| {
        let apart = (time(i) - time(j)).abs();
        0.04 * (-apart / 0.3).exp() + if i == j { 0.001 } else { 0.0 }
    });
    let y = made(&noise, 2);
    let mut table = "time [s],y\n".to_owned();
    for (i, y) in y.iter().enumerate() {
        writeln!(table, "{},{y:.6}", time(i)).unwrap();
    }
    let folder = study(&table);
    let row =
        |i: usize| (0..TIMES).map(|j| format!("{:e}", noise[(i, j)])).collect::<Vec<_>>().join(",");
    let text: String = (0..TIMES).map(|i| row(i) + "\n").collect();
    fs::write(folder.path().join("covariance.csv"), text).unwrap();
    has(folder.path(), &["measurements.covariance=covariance.csv"], closed_form(&y, &noise));
}
