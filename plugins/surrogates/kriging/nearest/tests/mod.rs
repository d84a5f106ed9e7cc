//! Comparison with the exact process, which all runs as neighbours must give.

mod cases;
mod functions;

use lacuna::math::random::{Stream, normal};
use lacuna_linalg::{Cholesky, Matrix, multiply, symmetric_eigen};

use super::super::field::{Choice, Field, Runs};
use super::super::likelihood::{Restricted, Scored, measured};
use super::super::tests::{KERNELS, Sample, choice, close, has_the_gradient_of_differences, trend};
use super::*;
use crate::surrogates::gaussian_process::tests::recurrence;

const AT: [f64; 3] = [-0.9, -0.35, -6.9];

fn neighbours(sample: &Sample, count: usize) -> Neighbours {
    let scales: Vec<f64> = AT[..2].iter().map(|x| x.exp()).collect();
    Neighbours::of(&measured(&sample.points, &scales), count)
}

#[test]
fn all_neighbours_give_the_exact_likelihood() {
    let sample = Sample::new(60);
    for kernel in KERNELS {
        let whole = sample.problem(kernel);
        let nearby = Nearby { whole, neighbours: &neighbours(&sample, 59) };
        let exact = whole.slopes(&AT).unwrap();
        let found = Scored::slopes(&nearby, &AT).unwrap();
        close(found.value, exact.value, 1e-10);
        assert_eq!(found.value, nearby.value(&AT));
        for (a, b) in found.gradient.iter().zip(&exact.gradient) {
            close(*a, *b, 1e-8);
        }
    }
}

#[test]
fn all_neighbours_give_the_exact_predictions() {
    let sample = Sample::new(60);
    let fresh = recurrence(60, 12, 2).transposed();
    let regressors = trend(&fresh);
    for kernel in KERNELS {
        let exact = Field::new(kernel, choice(), sample.runs()).unwrap();
        let choice = Choice { neighbours: Some(59), ..choice() };
        let found = Field::new(kernel, choice, sample.runs()).unwrap();
        close(found.log_likelihood, exact.log_likelihood, 1e-8);
        assert_eq!(found.nugget, exact.nugget);
        let same = |a: &Matrix, b: &Matrix| {
            assert_eq!((a.rows(), a.columns()), (b.rows(), b.columns()));
            a.as_slice().iter().zip(b.as_slice()).for_each(|(a, b)| close(*a, *b, 1e-8));
        };
        same(&found.mean(&fresh, &regressors), &exact.mean(&fresh, &regressors));
        same(&found.variance(&fresh, &regressors), &exact.variance(&fresh, &regressors));
        same(&found.covariance(&fresh, &regressors), &exact.covariance(&fresh, &regressors));
        same(&found.left_out(), &exact.left_out());
        let place = fresh.column(0);
        same(&found.gradient(&place).0, &exact.gradient(&place).0);
        close(found.left_out_ratio(), exact.left_out_ratio(), 1e-8);
    }
}

#[test]
fn gradients_are_those_of_differences() {
    let sample = Sample::new(80);
    let neighbours = neighbours(&sample, 6);
    for kernel in KERNELS {
        for components in [vec![1], vec![0, 1, 2]] {
            let scores = sample.scores.select_columns(&components);
            let whole = Restricted { scores: &scores, ..sample.problem(kernel) };
            let nearby = Nearby { whole, neighbours: &neighbours };
            for at in [AT, [-1.0, -0.3, -9.0], [-1.8, -1.5, -2.0]] {
                has_the_gradient_of_differences(&nearby, |point| nearby.value(point), at);
                let information = Scored::slopes(&nearby, &at).unwrap().information;
                let eigen = symmetric_eigen(&information).unwrap();
                assert!(eigen.values.iter().all(|v| *v > 0.0), "{:?}", eigen.values);
            }
        }
    }
}

/// The mean of the information over realisations of the process is the Fisher information with the variance profiled
/// out, `1/2 [tr(K^-1 dK_i K^-1 dK_j) - tr(K^-1 dK_i) tr(K^-1 dK_j) / N]`, within five standard errors and a part of the
/// order of `1 / N`, because the variance is estimated.
#[test]
fn the_information_is_that_of_fisher_on_average() {
    let sample = Sample::new(30);
    let (kernel, scales) = (KERNELS[0], [0.5, 0.8]);
    let at = [0.5_f64.ln(), 0.8_f64.ln(), 0.01_f64.ln()];
    let covariance = |at: &[f64]| {
        let place = measured(&sample.points, &[at[0].exp(), at[1].exp()]);
        let mut k = kernel.between(&place, &place);
        (0..30).for_each(|i| k[(i, i)] += at[2].exp());
        k
    };
    let root = Cholesky::new(&covariance(&at)).unwrap();
    let change = |k: usize| {
        let moved = |by: f64| {
            let mut moved = at;
            moved[k] += by;
            covariance(&moved)
        };
        let (up, down) = (moved(1e-5), moved(-1e-5));
        root.solve_matrix(&Matrix::from_fn(30, 30, |i, j| (up[(i, j)] - down[(i, j)]) / 2e-5))
    };
    let changes: Vec<Matrix> = (0..3).map(change).collect();
    let trace = |a: &Matrix| (0..30).map(|i| a[(i, i)]).sum::<f64>();
    let neighbours = Neighbours::of(&measured(&sample.points, &scales), 29);
    let (draws, none) = (2000, Matrix::zeros(30, 0));
    let mut rng = Stream::root(4).generator();
    let mut sums = vec![[0.0; 2]; 9];
    for _ in 0..draws {
        let z: Vec<f64> = (0..30).map(|_| normal(&mut rng)).collect();
        let scores = Matrix::from_vec(30, 1, root.colour(&z));
        let whole = Restricted { trend: &none, scores: &scores, ..sample.problem(kernel) };
        let found = Scored::slopes(&Nearby { whole, neighbours: &neighbours }, &at).unwrap();
        for (sum, x) in sums.iter_mut().zip(found.information.as_slice()) {
            sum[0] += x;
            sum[1] += x * x;
        }
    }
    let count = f64::from(draws);
    for (k, [sum, squares]) in sums.into_iter().enumerate() {
        let (a, b) = (&changes[k / 3], &changes[k % 3]);
        let expected = 0.5 * (trace(&multiply(a, b)) - trace(a) * trace(b) / 30.0);
        let mean = sum / count;
        let error = ((squares / count - mean * mean) / count).sqrt();
        let order = 2.0 / 30.0 * (0.5 * trace(&multiply(a, a)) * trace(&multiply(b, b))).sqrt();
        let off = (mean - expected).abs();
        assert!(off < 5.0 * error + order, "{k}: {mean} {error} {expected} {order}");
    }
}

fn near_field(sample: &Sample, neighbours: usize) -> Field {
    let choice = Choice { neighbours: Some(neighbours), ..choice() };
    Field::new(KERNELS[0], choice, sample.runs()).unwrap()
}

/// The variance from few neighbours is that of a dense inverse over them, at least the exact one and the nugget; the
/// mean is that of all runs, and so is its gradient.
#[test]
fn few_neighbours_change_the_variance_alone() {
    let sample = Sample::new(150);
    let fresh = recurrence(150, 40, 2).transposed();
    let regressors = trend(&fresh);
    let exact = Field::new(KERNELS[0], choice(), sample.runs()).unwrap();
    let found = near_field(&sample, 20);
    let (a, b) = (found.variance(&fresh, &regressors), exact.variance(&fresh, &regressors));
    for i in 0..40 {
        for c in 0..3 {
            let (share, least) =
                (a[(i, c)] / found.variances()[c], b[(i, c)] / exact.variances()[c]);
            assert!(share >= least * (1.0 - 1e-3) && share >= found.nugget, "{share} {least}");
            assert!(share < 1.3 * least, "{share} {least}");
        }
    }
    let (a, b) = (found.mean(&fresh, &regressors), exact.mean(&fresh, &regressors));
    a.as_slice().iter().zip(b.as_slice()).for_each(|(a, b)| close(*a, *b, 2e-3));
    let (place, step) = (fresh.column(3), 1e-5);
    let (process, beta) = found.gradient(&place);
    for k in 0..2 {
        let shifted = |by: f64| {
            let mut point = place.clone();
            point[k] += by;
            let point = Matrix::from_vec(2, 1, point);
            found.mean(&point, &trend(&point))
        };
        let (up, down) = (shifted(step), shifted(-step));
        for c in 0..3 {
            let difference = (up[(0, c)] - down[(0, c)]) / (2.0 * step);
            close(process[(c, k)] + beta[(c, k + 1)], difference, 1e-7);
        }
    }
}

/// Errors at points that share neighbours are correlated as any errors can be: no combination of them has a negative
/// variance.
#[test]
fn covariances_are_those_of_errors() {
    let sample = Sample::new(120);
    let fresh = recurrence(120, 30, 2).transposed();
    let found = near_field(&sample, 8);
    let covariance = found.shared_covariance(&fresh, &trend(&fresh));
    let eigen = symmetric_eigen(&covariance).unwrap();
    let largest = eigen.values[29];
    assert!(eigen.values[0] > -1e-12 * largest, "{:?}", eigen.values);
    let variance = found.variance(&fresh, &trend(&fresh));
    for i in 0..30 {
        let expected = variance[(i, 0)] / found.variances()[0] - found.nugget;
        close(covariance[(i, i)], expected, 1e-12);
    }
}

/// Left-out runs are predicted by processes that are conditioned anew on the others.
#[test]
fn runs_left_out_are_those_of_fits_without_them() {
    let sample = Sample::new(80);
    let found = near_field(&sample, 25).left_out();
    let mut ratios = Vec::new();
    for out in 0..80 {
        let rest: Vec<usize> = (0..80).filter(|&i| i != out).collect();
        let runs = Runs {
            points: &sample.points.select_columns(&rest),
            regressors: &sample.regressors.select_rows(&rest),
            scores: &sample.scores.select_rows(&rest),
        };
        let place = sample.points.select_columns(&[out]);
        let choice = Choice { neighbours: Some(25), ..choice() };
        let without = Field::new(KERNELS[0], choice, runs).unwrap();
        let mean = without.mean(&place, &trend(&place));
        for c in 0..3 {
            let expected = sample.scores[(out, c)] - mean[(0, c)];
            let scale = without.variance(&place, &trend(&place))[(0, c)].sqrt();
            assert!((found[(out, c)] - expected).abs() < 0.1 * scale, "{out} {c}");
            ratios.push((found[(out, c)].powi(2), expected.powi(2)));
        }
    }
    let (a, b) = ratios.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
    assert!((0.99..1.1).contains(&(a / b)), "{}", a / b);
}
