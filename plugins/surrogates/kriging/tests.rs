//! Comparison with textbook formulas that use dense inverses, and with figures of a peer.

use lacuna::plugin::Target;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Matrix, multiply, multiply_transposed, multiply_vector};

use super::factor::Factor;
use super::field::{Choice, Field, Runs};
use super::kernel::Kernel;
use super::likelihood::{Restricted, measured};
use super::options::{Bounds, Nugget};
use crate::surrogates::gaussian_process::tests::recurrence;

pub(super) const KERNELS: [Kernel; 3] =
    [Kernel::Matern52, Kernel::Matern32, Kernel::SquaredExponential];

/// Returns the inverse by Gauss-Jordan elimination with pivoting, and the logarithm of the absolute determinant.
fn inverse(a: &Matrix) -> (Matrix, f64) {
    let n = a.rows();
    let (mut a, mut inverse) =
        (a.clone(), Matrix::from_fn(n, n, |i, j| f64::from(u8::from(i == j))));
    let mut determinant = 0.0;
    for k in 0..n {
        let size = |i: &usize| a[(*i, k)].abs();
        let pivot = (k..n).max_by(|i, j| size(i).total_cmp(&size(j))).unwrap();
        for m in [&mut a, &mut inverse] {
            for j in 0..n {
                (m[(k, j)], m[(pivot, j)]) = (m[(pivot, j)], m[(k, j)]);
            }
        }
        let top = a[(k, k)];
        determinant += top.abs().ln();
        for m in [&mut a, &mut inverse] {
            m.row_mut(k).iter_mut().for_each(|x| *x /= top);
        }
        for i in (0..n).filter(|&i| i != k) {
            let factor = a[(i, k)];
            for m in [&mut a, &mut inverse] {
                for j in 0..n {
                    let above = m[(k, j)];
                    m[(i, j)] -= factor * above;
                }
            }
        }
    }
    (inverse, determinant)
}

/// Runs of two parameters with a linear trend and three components.
pub(super) struct Sample {
    /// One run per column.
    pub points: Matrix,
    pub regressors: Matrix,
    pub scores: Matrix,
}

impl Sample {
    pub fn new(runs: usize) -> Self {
        let points = recurrence(0, runs, 2).transposed();
        let at = |i: usize| (points[(0, i)], points[(1, i)]);
        let regressors = trend(&points);
        let scores = Matrix::from_fn(runs, 3, |i, c| {
            let (x, y) = at(i);
            (4.0 * x + c as f64).sin() * (2.0 * y).exp() + 0.1 * ((37 * i * (c + 1)) as f64).sin()
        });
        Self { points, regressors, scores }
    }

    pub fn problem(&self, kernel: Kernel) -> Restricted<'_> {
        let Self { points, regressors, scores } = self;
        let (bounds, nugget) = (Bounds::default(), Nugget::default());
        Restricted { kernel, points, trend: regressors, scores, bounds, nugget }
    }

    pub fn runs(&self) -> Runs<'_> {
        let Self { points, regressors, scores } = self;
        Runs { points, regressors, scores }
    }
}

pub(super) fn trend(points: &Matrix) -> Matrix {
    Matrix::from_fn(points.columns(), 3, |i, j| if j == 0 { 1.0 } else { points[(j - 1, i)] })
}

pub(super) fn choice() -> Choice {
    Choice {
        components: vec![0, 1, 2],
        terms: vec![0, 1, 2],
        length_scales: vec![0.4, 0.7],
        nugget: 1e-3,
        neighbours: None,
    }
}

/// Returns the full covariance at some hyperparameters, both triangles.
fn covariance(kernel: Kernel, points: &Matrix, choice: &Choice) -> Matrix {
    let points = measured(points, &choice.length_scales);
    let mut k = kernel.between(&points, &points);
    (0..k.rows()).for_each(|i| k[(i, i)] += choice.nugget);
    k
}

/// `P` and its parts by textbook formulas.
struct Textbook {
    inverse: Matrix,
    information: Matrix,
    projection: Matrix,
    log_determinants: f64,
}

impl Textbook {
    fn new(covariance: &Matrix, trend: &Matrix) -> Self {
        let (k, log_k) = inverse(covariance);
        let weighted = multiply(&k, trend);
        let (information, log_f) = inverse(&multiply(&trend.transposed(), &weighted));
        let taken = multiply(&multiply(&weighted, &information), &weighted.transposed());
        let n = k.rows();
        let projection = Matrix::from_fn(n, n, |i, j| k[(i, j)] - taken[(i, j)]);
        Self { inverse: k, information, projection, log_determinants: log_k + log_f }
    }
}

pub(super) fn close(found: f64, expected: f64, tolerance: f64) {
    let scale = expected.abs().max(1.0);
    assert!((found - expected).abs() <= tolerance * scale, "{found} and not {expected}");
}

#[test]
fn likelihood_and_information_are_those_of_the_textbook() {
    let sample = Sample::new(25);
    for kernel in KERNELS {
        let (problem, choice) = (sample.problem(kernel), choice());
        let book = Textbook::new(&covariance(kernel, &sample.points, &choice), &sample.regressors);
        let at = [0.4_f64.ln(), 0.7_f64.ln(), 1e-3_f64.ln()];
        let moved = |k: usize, by: f64| {
            let mut moved = choice.clone();
            match k {
                2 => moved.nugget *= by.exp(),
                k => moved.length_scales[k] *= by.exp(),
            }
            covariance(kernel, &sample.points, &moved)
        };
        let changes: Vec<Matrix> = (0..3)
            .map(|k| {
                let (up, down) = (moved(k, 1e-5), moved(k, -1e-5));
                Matrix::from_fn(25, 25, |i, j| (up[(i, j)] - down[(i, j)]) / 2e-5)
            })
            .collect();
        let (mut value, mut information) = (0.0, Matrix::zeros(3, 3));
        for c in 0..3 {
            let y = sample.scores.column(c);
            let alpha = multiply_vector(&book.projection, &y);
            let s = dot(&y, &alpha) / 22.0;
            value -=
                0.5 * (22.0 * (1.0 + (std::f64::consts::TAU * s).ln()) + book.log_determinants);
            let pulls: Vec<Vec<f64>> =
                changes.iter().map(|change| multiply_vector(change, &alpha)).collect();
            for i in 0..3 {
                for j in 0..3 {
                    let both = dot(&pulls[i], &multiply_vector(&book.projection, &pulls[j])) / s;
                    let along = dot(&alpha, &pulls[i]) * dot(&alpha, &pulls[j]) / (s * s * 22.0);
                    information[(i, j)] += 0.5 * (both - along);
                }
            }
        }
        let found = problem.slopes(&at).unwrap();
        close(found.value, value, 1e-9);
        close(problem.value(&at), value, 1e-9);
        for (a, b) in found.information.as_slice().iter().zip(information.as_slice()) {
            close(*a, *b, 1e-6);
        }
    }
}

/// Compares value and gradient of a likelihood with differences of its values, to the fourth order in their step.
pub(super) fn has_the_gradient_of_differences(
    likelihood: &dyn Target,
    value: impl Fn(&[f64]) -> f64,
    at: [f64; 3],
) {
    let (found, gradient) = likelihood.gradient(&at);
    assert_eq!(found, value(&at));
    for k in 0..3 {
        let shifted = |by: f64| {
            let mut point = at;
            point[k] += by;
            value(&point)
        };
        let difference =
            (8.0 * (shifted(1e-3) - shifted(-1e-3)) - (shifted(2e-3) - shifted(-2e-3))) / 12e-3;
        close(gradient[k], difference, 1e-7);
    }
}

#[test]
fn gradients_are_those_of_differences() {
    let sample = Sample::new(40);
    for kernel in KERNELS {
        for components in [vec![1], vec![0, 1, 2]] {
            let scores = sample.scores.select_columns(&components);
            let problem = Restricted { scores: &scores, ..sample.problem(kernel) };
            for at in [[-1.0, -0.3, -6.0], [-0.5, 0.4, -9.0], [-1.8, -1.5, -2.0]] {
                has_the_gradient_of_differences(&problem, |point| problem.value(point), at);
            }
        }
    }
}

/// Source: Rasmussen and Williams (2006), equations 2.41 and 2.42.
#[test]
fn predictions_are_those_of_dense_inverses() {
    let sample = Sample::new(30);
    let fresh = recurrence(30, 9, 2).transposed();
    for kernel in KERNELS {
        let field = Field::new(kernel, choice(), sample.runs()).unwrap();
        let (mean, variance) =
            (field.mean(&fresh, &trend(&fresh)), field.variance(&fresh, &trend(&fresh)));
        let book =
            Textbook::new(&covariance(kernel, &sample.points, &choice()), &sample.regressors);
        let scaled = |points: &Matrix| measured(points, &choice().length_scales);
        let between = kernel.between(&scaled(&fresh), &scaled(&sample.points));
        let weighted = multiply(&book.inverse, &sample.regressors);
        for c in 0..3 {
            let y = sample.scores.column(c);
            let beta = multiply_vector(&multiply_transposed(&book.information, &weighted), &y);
            let fitted = multiply_vector(&sample.regressors, &beta);
            let rest: Vec<f64> = y.iter().zip(&fitted).map(|(a, b)| a - b).collect();
            let pull = multiply_vector(&book.inverse, &rest);
            let s = dot(&y, &multiply_vector(&book.projection, &y)) / 27.0;
            for i in 0..9 {
                let (k, f) = (between.row(i), trend(&fresh));
                close(mean[(i, c)], dot(f.row(i), &beta) + dot(k, &pull), 1e-8);
                let known = dot(k, &multiply_vector(&book.inverse, k));
                let u: Vec<f64> = (0..3).map(|t| f[(i, t)] - dot(k, &weighted.column(t))).collect();
                let unknown = dot(&u, &multiply_vector(&book.information, &u));
                close(variance[(i, c)], s * (1.0 + 1e-3 - known + unknown), 1e-8);
            }
        }
    }
}

#[test]
fn runs_left_out_are_those_of_fits_without_them() {
    let sample = Sample::new(30);
    for kernel in KERNELS {
        let left_out = Field::new(kernel, choice(), sample.runs()).unwrap().left_out();
        for out in 0..30 {
            let rest: Vec<usize> = (0..30).filter(|&i| i != out).collect();
            let runs = Runs {
                points: &sample.points.select_columns(&rest),
                regressors: &sample.regressors.select_rows(&rest),
                scores: &sample.scores.select_rows(&rest),
            };
            let place = sample.points.select_columns(&[out]);
            let mean = Field::new(kernel, choice(), runs).unwrap().mean(&place, &trend(&place));
            for c in 0..3 {
                close(left_out[(out, c)], sample.scores[(out, c)] - mean[(0, c)], 1e-8);
            }
        }
    }
}

#[test]
fn gradients_of_the_mean_are_those_of_differences() {
    let sample = Sample::new(30);
    for kernel in KERNELS {
        let field = Field::new(kernel, choice(), sample.runs()).unwrap();
        let at = [0.37, 0.61];
        let (process, beta) = field.gradient(&at);
        for k in 0..2 {
            let shifted = |by: f64| {
                let mut point = at;
                point[k] += by;
                let point = Matrix::from_vec(2, 1, point.to_vec());
                field.mean(&point, &trend(&point))
            };
            let (up, down) = (shifted(1e-5), shifted(-1e-5));
            for c in 0..3 {
                let difference = (up[(0, c)] - down[(0, c)]) / 2e-5;
                close(process[(c, k)] + beta[(c, k + 1)], difference, 1e-7);
            }
        }
    }
}

/// Source: scikit-learn 1.9.1,
/// `GaussianProcessRegressor(ConstantKernel(s2) * kernel([0.4, 0.7]), alpha=1e-4 * s2, optimizer=None)` with
/// `s2 = y' K^-1 y / N`, no trend: log marginal likelihood, and mean and variance (without noise) at three points.
#[test]
fn figures_are_those_of_a_peer() {
    let peers = [
        (
            Kernel::Matern52,
            -7.221_961_883_447_797,
            [0.142_875_340_542_223_84, 0.519_707_841_402_054, -0.593_746_080_565_926_7],
            [0.065_000_534_870_319_63, 0.014_885_758_371_665_612, 0.049_568_658_612_580_196],
        ),
        (
            Kernel::Matern32,
            -7.526_105_920_906_265,
            [0.251_760_669_813_910_65, 0.523_557_325_451_729_7, -0.467_529_329_474_733_25],
            [0.098_558_494_596_710_41, 0.033_268_702_445_177, 0.078_260_984_962_834_96],
        ),
        (
            Kernel::SquaredExponential,
            -7.553_725_282_997_330_5,
            [-0.052_938_371_536_953_355, 0.541_959_243_478_64, -0.840_314_657_126_654_6],
            [0.018_829_863_586_053_1, 0.002_053_352_694_495_025_3, 0.015_311_565_029_709_763],
        ),
    ];
    let points = recurrence(0, 12, 2).transposed();
    let fresh = recurrence(12, 3, 2).transposed();
    let scores = Matrix::from_fn(12, 1, |i, _| {
        (5.0 * points[(0, i)]).sin() * (3.0 * points[(1, i)]).cos() + points[(1, i)]
    });
    let none = Matrix::zeros(12, 0);
    for (kernel, log_likelihood, means, variances) in peers {
        let choice = Choice {
            components: vec![0],
            terms: Vec::new(),
            length_scales: vec![0.4, 0.7],
            nugget: 1e-4,
            neighbours: None,
        };
        let runs = Runs { points: &points, regressors: &none, scores: &scores };
        let field = Field::new(kernel, choice, runs).unwrap();
        close(field.log_likelihood, log_likelihood, 1e-10);
        let regressors = Matrix::zeros(3, 0);
        let (mean, variance) =
            (field.mean(&fresh, &regressors), field.variance(&fresh, &regressors));
        let total = field.variance(&Matrix::from_vec(2, 1, vec![1e6, 1e6]), &Matrix::zeros(1, 0));
        let noise = total[(0, 0)] * 1e-4 / (1.0 + 1e-4);
        for i in 0..3 {
            close(mean[(i, 0)], means[i], 1e-9);
            close(variance[(i, 0)] - noise, variances[i], 1e-9);
        }
    }
}

#[test]
fn singular_covariances_are_factored_with_jitter() {
    let same = Matrix::from_fn(5, 5, |_, _| 1.0);
    let (_, jitter) = Factor::new(same, &Matrix::zeros(5, 0)).unwrap();
    assert!(jitter > 0.0 && jitter < 1e-11);
    let dependent = Matrix::from_fn(5, 2, |_, j| (j + 1) as f64);
    let unit = Matrix::from_fn(5, 5, |i, j| f64::from(u8::from(i == j)));
    assert!(Factor::new(unit, &dependent).is_none());
}
