//! The smoother against the closed form of an orthogonal process, and descriptions of known regions.
#![allow(clippy::unwrap_used)]

use lacuna::expression::{Evaluator, Scope};
use lacuna::math::random::Stream;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{
    Cholesky, Matrix, multiply, multiply_transposed, multiply_vector, transposed_multiply,
};

use super::features::Features;
use super::process::{Kernel, Process};
use super::{Symbolic, describe, smooth, symbolic};
use crate::gap::system::System;
use crate::gap::system::fit::{Fit, fit};
use crate::gap::system::whitener::Whitener;
use crate::gap::test::{Cell, Region};
use crate::gap::testing::SyntheticExperiment;

const TIMES: usize = 60;

fn world(memory: f64) -> SyntheticExperiment {
    SyntheticExperiment::new(
        &["x", "y"],
        &["a", "b"],
        TIMES,
        memory,
        &["level", "rate"],
        |j, _, _, t| {
            if j == 0 { 1.0 } else { t / TIMES as f64 }
        },
    )
}

fn region(curves: Vec<usize>, window: (usize, usize), band: Option<(usize, usize)>) -> Region {
    let cell = Cell { place: curves[0], window, band, statistic: 9.0 };
    Region { span: (window.0 as f64, window.1 as f64), curves, cell, p: 0.01 }
}

/// The process conditioned on nothing along the slopes has the covariance `C = K - K J (J'KJ)^-1 J'K` (Plumlee 2017,
/// equation 7); its mean is `C (C + I)^-1 z` and its log evidence against none
/// `(z'z - z'(C + I)^-1 z - log|C + I|) / 2` in white noise.
#[test]
fn the_process_is_that_of_its_closed_form() {
    let world = world(0.0);
    let mut truth = world.response(&[0.4, 0.2]);
    (10..30).for_each(|i| truth[i] += 2.0);
    let experiment = world.experiment(&truth, 1, &Stream::root(4));
    let (_, means) = experiment.means();
    let whitener = Whitener::new(&experiment, &world.noise, &means);
    let system = System::new(&experiment, Vec::new());
    let found: Fit = fit(&system, &whitener, &means, &[0.0, 0.0]);
    let curves = [(0, 1.0), (1, 0.7)];
    let features = Features::new(&experiment, &found, &whitener, &curves, 25).unwrap();
    let (shape, amplitude) = (Kernel { length: 6.0, middle: 0.3 }, 1.3);
    let process = Process::new(&features, &shape).unwrap();
    let n = means.len();
    let weight: Vec<f64> = features.angular.iter().map(|w| shape.density(*w)).collect();
    let scaled = Matrix::from_fn(features.rows.rows(), n, |a, i| {
        amplitude * weight[a].sqrt() * features.rows[(a, i)]
    });
    let kernel = transposed_multiply(&scaled, &scaled);
    let slopes = found.slopes.transposed();
    let along = multiply(&kernel, &slopes);
    let middle = Cholesky::new(&transposed_multiply(&slopes, &along)).unwrap();
    let taken = multiply(&along, &middle.solve_matrix(&along.transposed()));
    let c = Matrix::from_fn(n, n, |i, j| kernel[(i, j)] - taken[(i, j)]);
    let whole = Matrix::from_fn(n, n, |i, j| c[(i, j)] + f64::from(u8::from(i == j)));
    let factor = Cholesky::new(&whole).unwrap();
    let mut solved = found.residual.clone();
    factor.solve(&mut solved);
    let z = &found.residual;
    let exact = 0.5 * (dot(z, z) - dot(z, &solved) - factor.log_determinant());
    let value = process.log_evidence(amplitude);
    assert!((value - exact).abs() < 1e-6 * exact.abs().max(1.0), "{value} {exact}");
    let posterior = process.posterior(amplitude);
    let mean = multiply_vector(&c, &solved);
    let rest = multiply(&c, &factor.solve_matrix(&c));
    for i in 0..n {
        assert!((posterior.mean[i] - mean[i]).abs() < 1e-6, "{i}");
        let variance = c[(i, i)] - rest[(i, i)];
        assert!((posterior.sd[i].powi(2) - variance).abs() < 1e-6, "{i}: {variance}");
    }
    for j in 0..2 {
        assert!(dot(found.slopes.row(j), &posterior.mean).abs() < 1e-8);
    }
    // A linear smoother with the matrix A explains the energy z'(2A - A^2)z; under white noise its expectation is the
    // trace of 2A - A^2.
    let smoother = factor.solve_matrix(&c);
    let square = multiply_transposed(&smoother, &smoother.transposed());
    let part = Matrix::from_fn(n, n, |i, j| 2.0 * smoother[(i, j)] - square[(i, j)]);
    let (taken, of_noise) = process.taken(amplitude);
    assert!((taken - dot(z, &multiply_vector(&part, z))).abs() < 1e-6 * taken);
    let trace: f64 = (0..n).map(|i| part[(i, i)]).sum();
    assert!((of_noise - trace).abs() < 1e-6 * trace, "{of_noise} {trace}");
}

/// An oscillation that no parameter reproduces is found with its frequency, and lies inside the band of the smoother.
#[test]
fn a_swing_is_bridged() {
    let world = world(0.4);
    let mut truth = world.response(&[0.4, 0.2]);
    let swing: Vec<f64> =
        (0..TIMES).map(|t| 2.0 * (std::f64::consts::TAU * 0.15 * t as f64).sin()).collect();
    truth[..TIMES].iter_mut().zip(&swing).for_each(|(y, s)| *y += s);
    let experiment = world.experiment(&truth, 10, &Stream::root(5));
    let (_, means) = experiment.means();
    let whitener = Whitener::new(&experiment, &world.noise, &means);
    let system = System::new(&experiment, Vec::new());
    let found = fit(&system, &whitener, &means, &[0.0, 0.0]);
    let excess = dot(&found.residual, &found.residual) - (means.len() - 2) as f64;
    let here = [region(vec![0], (0, TIMES - 1), None)];
    let bridged = smooth(&system, &found, &world.noise, &whitener, &here, excess).unwrap();
    // Sixty seconds of data resolve frequencies that differ by 1/60 Hz.
    assert!((bridged.frequency - 0.15).abs() < 1.0 / 60.0, "{}", bridged.frequency);
    assert!(bridged.explained > 0.9 && bridged.log_evidence > 50.0, "{bridged:?}");
    let inside =
        (0..TIMES).filter(|&t| (bridged.mean[t] - swing[t]).abs() < 1.96 * bridged.sd[t] + 0.1);
    assert!(inside.count() > TIMES * 9 / 10);
    assert!(bridged.mean[TIMES..].iter().all(|y| *y == 0.0));
}

/// Cosine k over n values a second apart has k / (2 n) Hz. The strength is the root of the sum of `36 cos^2` over the
/// window by its 31 * 16 / 60 degrees of freedom.
#[test]
fn regions_are_described() {
    let world = world(0.0);
    let experiment = world.experiment(&world.response(&[0.0, 0.0]), 2, &Stream::root(6));
    let mut left = vec![0.0; experiment.outputs()];
    for t in 0..TIMES {
        let wave = (std::f64::consts::PI * 18.0 * (t as f64 + 0.5) / TIMES as f64).cos();
        left[TIMES + t] = 6.0 * wave;
        left[3 * TIMES + t] = 3.0 * wave;
    }
    let found = describe(&experiment, &region(vec![1], (10, 40), Some((16, 32))), &left);
    assert_eq!(
        found.words,
        "`b` under `x`, time 10 to 40 s, in the band from 0.133 to 0.258 Hz: 8.29 times the noise of the \
         mean; also under `y` (4.15)"
    );
    assert_eq!(found.band, Some((16.0 / 120.0, 31.0 / 120.0)));
    let whole = describe(&experiment, &region(vec![0], (0, 59), None), &left);
    assert_eq!(
        whole.words,
        "`a` under `x`, over the whole time: 0 times the noise of the mean; not under `y`"
    );
}

/// A wave of known frequency and size that the parameters scale.
fn waves() -> SyntheticExperiment {
    SyntheticExperiment::new(
        &["x", "y"],
        &["a", "b"],
        TIMES,
        0.3,
        &["wave", "level"],
        |j, c, s, t| {
            let phase = 0.25 * (c + 1) as f64 * t + 0.4 * s as f64;
            if j == 0 { 4.0 * phase.sin() } else { 1.0 }
        },
    )
}

fn form_of(world: &SyntheticExperiment, truth: &[f64], seed: u64) -> Option<Symbolic> {
    let experiment = world.experiment(truth, 8, &Stream::root(seed));
    let (_, means) = experiment.means();
    let whitener = Whitener::new(&experiment, &world.noise, &means);
    let system = System::new(&experiment, Vec::new());
    let found = fit(&system, &whitener, &means, &[0.5, 0.0]);
    let excess = dot(&found.residual, &found.residual) - (means.len() - 2) as f64;
    symbolic(&system, &found, &whitener, &[], excess, 99, &Stream::root(2))
}

/// A quadratic loss on all sensors is found with its coefficient, and its expression reproduces it.
#[test]
fn a_quadratic_loss_is_written_down() {
    let world = waves();
    let plain = world.response(&[1.0, 0.0]);
    let truth: Vec<f64> = plain.iter().map(|y| y - 0.05 * y * y).collect();
    let found = form_of(&world, &truth, 21).unwrap();
    assert_eq!(found.terms.len(), 1, "{found:?}");
    assert_eq!(found.terms[0].functions, ["y^2"], "{found:?}");
    let own = &found.terms[0].coefficients[0];
    assert!(own.on.is_empty() && (own.values[0] + 0.05).abs() < 4.0 * own.sd[0], "{found:?}");
    assert!(found.gain > 4.0 * found.by_chance && found.explained > 0.5, "{found:?}");
    let written = &found.expressions[0];
    assert_eq!(written.formula, "y + size * (y^2)");
    let mut scope = Scope::new();
    for name in ["y", "t", "size"] {
        scope.unknown(name).unwrap();
    }
    scope.result("formula ", &written.formula).unwrap();
    let program = scope.compile(&["formula "]).unwrap();
    let mut evaluator = Evaluator::new(&program);
    evaluator.at(&[3.0, 1.0, written.parameters[0].1]);
    let mut out = [0.0];
    evaluator.values(&mut out);
    assert!((out[0] - (3.0 + own.values[0] * 9.0)).abs() < 1e-12);
}

/// A sine of one sensor is found on that alone; a friction of the sign of the slope is no
/// formula of the response alone.
#[test]
fn terms_of_one_sensor_and_of_slopes_are_found() {
    let world = waves();
    let plain = world.response(&[1.0, 0.0]);
    let sine: Vec<f64> = (0..plain.len())
        .map(|i| {
            let t = (i % TIMES) as f64;
            let on_b = f64::from(u8::from(i / TIMES % 2 == 1));
            plain[i] + 1.5 * on_b * (std::f64::consts::TAU * 10.0 / 59.0 * t).sin()
        })
        .collect();
    let found = form_of(&world, &sine, 22).unwrap();
    assert!(found.terms[0].functions[0].starts_with("sin(2 * pi * 0.169"), "{found:?}");
    let coefficients = &found.terms[0].coefficients;
    assert_eq!(coefficients.len(), 1, "{found:?}");
    assert_eq!(coefficients[0].on["sensor"], ["b"], "{found:?}");
    assert!((coefficients[0].values[0] - 1.5).abs() < 4.0 * coefficients[0].sd[0], "{found:?}");
    assert_eq!(found.expressions.len(), 1, "{found:?}");
    assert_eq!(found.expressions[0].on["sensor"], ["b"]);
    let rubbed: Vec<f64> = (0..plain.len())
        .map(|i| {
            let phase = 0.25 * (i / (2 * TIMES) + 1) as f64 * (i % TIMES) as f64;
            plain[i] - 0.8 * (phase + 0.4 * (i / TIMES % 2) as f64).cos().signum()
        })
        .collect();
    let found = form_of(&world, &rubbed, 23).unwrap();
    assert_eq!(found.terms[0].functions, ["sign(dy)"], "{found:?}");
    assert!(found.expressions.is_empty());
}

/// On noise alone a form is found no more often than the level of its test: a twentieth of 40 cases is 2, and four
/// standard deviations above it are 7.5.
#[test]
fn noise_alone_has_no_form() {
    let world = waves();
    let truth = world.response(&[1.0, 0.5]);
    let found = (0..40).filter(|seed| form_of(&world, &truth, 300 + seed).is_some());
    assert!(found.count() <= 7);
}
