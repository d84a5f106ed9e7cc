//! Indices against closed forms.

use std::f64::consts::PI;

use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna_linalg::Matrix;

use super::{Independent, Indices, Inputs, evaluations, indices};

const SAMPLES: usize = 2000;

/// Number of repetitions that are averaged: the standard error of one may be too small by chance, above all where the
/// contributions of samples have heavy tails, as those of the g-function; that of the average is known far better.
const REPEATED: u64 = 20;

/// Multiple of the standard error: exceeded with a probability of 6e-5.
const ERRORS: f64 = 4.0;

fn of(inputs: &dyn Inputs, samples: usize, f: impl Fn(&[f64]) -> f64) -> Indices {
    let evaluate =
        |points: &Matrix| Matrix::from_vec(points.rows(), 1, points.iter_rows().map(&f).collect());
    let one = |k| indices(inputs, samples, &Stream::root(7).at(k), evaluate, |_, _| ());
    let all: Vec<Indices> = (0..REPEATED).map(one).collect();
    let count = REPEATED as f64;
    let over = |part: &dyn Fn(&Indices) -> Matrix, power: i32| {
        let mean = |i| all.iter().map(|found| part(found)[(0, i)].powi(power)).sum::<f64>() / count;
        let root = |i| if power == 2 { (mean(i) / count).sqrt() } else { mean(i) };
        Matrix::from_fn(1, inputs.dimension(), |_, i| root(i))
    };
    Indices {
        first: over(&|found| found.first.clone(), 1),
        first_error: over(&|found| found.first_error.clone(), 2),
        total: over(&|found| found.total.clone(), 1),
        total_error: over(&|found| found.total_error.clone(), 2),
        shapley: over(&|found| found.shapley.clone(), 1),
        shapley_error: over(&|found| found.shapley_error.clone(), 2),
    }
}

/// Requires estimates within their errors, and errors below a bound.
fn agree(what: &str, found: &Matrix, errors: &Matrix, expected: &[f64], bound: f64) {
    for (i, &truth) in expected.iter().enumerate() {
        let (value, error) = (found[(0, i)], errors[(0, i)]);
        assert!(
            (value - truth).abs() <= ERRORS * error + 1e-12,
            "{what} {i}: {value} for {truth}, error {error}"
        );
        assert!(error < bound, "{what} {i}: error {error}");
    }
}

/// Ishigami function with a = 7, b = 0.1 (Ishigami and Homma 1990). Variance a²/8 + bπ⁴/5 + b²π⁸/18 + 1/2; the
/// interaction of the first and the third input is divided equally between their Shapley effects.
#[test]
fn ishigami() {
    let (a, b) = (7.0, 0.1);
    let inputs = Independent(vec![Distribution::Uniform([-PI, PI]); 3]);
    let found = of(&inputs, SAMPLES, |x| {
        x[0].sin() + a * x[1].sin().powi(2) + b * x[2].powi(4) * x[0].sin()
    });
    let alone = 0.5 * (1.0 + b * PI.powi(4) / 5.0).powi(2);
    let second = a * a / 8.0;
    let both = b * b * PI.powi(8) * (1.0 / 18.0 - 1.0 / 50.0);
    let all = alone + second + both;
    agree("first", &found.first, &found.first_error, &[alone / all, second / all, 0.0], 0.02);
    let total = [(alone + both) / all, second / all, both / all];
    agree("total", &found.total, &found.total_error, &total, 0.02);
    let shapley = [(alone + 0.5 * both) / all, second / all, 0.5 * both / all];
    agree("Shapley", &found.shapley, &found.shapley_error, &shapley, 0.02);
    assert!((found.shapley.as_slice().iter().sum::<f64>() - 1.0).abs() < 1e-12);
}

/// Sobol's g-function, a product of factors with variances 1 / 3 (1 + a)² (Saltelli and Sobol' 1995).
#[test]
fn g_function() {
    let a = [0.0, 1.0, 4.5, 9.0, 99.0, 99.0];
    let inputs = Independent(vec![Distribution::Uniform([0.0, 1.0]); 6]);
    let found = of(&inputs, SAMPLES, |x| {
        x.iter().zip(a).map(|(x, a)| ((4.0 * x - 2.0).abs() + a) / (1.0 + a)).product()
    });
    let parts = a.map(|a| 1.0 / (3.0 * (1.0 + a).powi(2)));
    let all = parts.iter().map(|v| 1.0 + v).product::<f64>() - 1.0;
    let first = parts.map(|v| v / all);
    agree("first", &found.first, &found.first_error, &first, 0.02);
    let total: Vec<f64> = parts.iter().map(|v| v * (1.0 + all) / ((1.0 + v) * all)).collect();
    agree("total", &found.total, &found.total_error, &total, 0.02);
    // The variance of each interaction is divided equally among its inputs.
    let mut shapley = [0.0; 6];
    for subset in 1_u32..64 {
        let own: Vec<usize> = (0..6).filter(|i| subset >> i & 1 == 1).collect();
        let variance: f64 = own.iter().map(|&i| parts[i]).product();
        for &i in &own {
            shapley[i] += variance / (own.len() as f64 * all);
        }
    }
    agree("Shapley", &found.shapley, &found.shapley_error, &shapley, 0.02);
}

/// Standard normal inputs, of which the last two are correlated.
struct Pair(f64);

impl Inputs for Pair {
    fn dimension(&self) -> usize {
        3
    }

    fn independent(&self) -> bool {
        false
    }

    fn draw(&self, stream: &Stream) -> Vec<f64> {
        self.redraw(&[0.0; 3], &[true; 3], stream)
    }

    fn redraw(&self, point: &[f64], free: &[bool], stream: &Stream) -> Vec<f64> {
        let mut generator = stream.generator();
        let z: Vec<f64> = (0..3).map(|_| normal(&mut generator)).collect();
        let rest = (1.0 - self.0 * self.0).sqrt();
        let mut drawn = point.to_vec();
        if free[0] {
            drawn[0] = z[0];
        }
        match (free[1], free[2]) {
            (true, true) => (drawn[1], drawn[2]) = (z[1], self.0 * z[1] + rest * z[2]),
            (true, false) => drawn[1] = self.0 * point[2] + rest * z[1],
            (false, true) => drawn[2] = self.0 * point[1] + rest * z[2],
            (false, false) => (),
        }
        drawn
    }
}

/// A linear function of normal inputs, of which two have the correlation ρ and the standard deviations σ. Owen and
/// Prieur, SIAM/ASA J. Uncertainty Quantification 5 (2017) 986, section 5: with `s = σ b`, input 2 has the share
/// `s2² (1 - ρ²/2) + ρ s2 s3 + ρ² s3² / 2`, and input 3 likewise.
#[test]
fn correlated_inputs_of_a_linear_function() {
    let (s, rho) = ([1.0, 1.5, -0.8], 0.6);
    let found = of(&Pair(rho), SAMPLES, |x| x.iter().zip(s).map(|(x, s)| s * x).sum());
    let all = s.iter().map(|s| s * s).sum::<f64>() + 2.0 * rho * s[1] * s[2];
    let share = |own: f64, other: f64| {
        own * own * (1.0 - 0.5 * rho * rho) + rho * own * other + 0.5 * rho * rho * other * other
    };
    let shapley = [s[0] * s[0], share(s[1], s[2]), share(s[2], s[1])].map(|v| v / all);
    assert!((shapley.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    agree("Shapley", &found.shapley, &found.shapley_error, &shapley, 0.02);
    let kept = 1.0 - rho * rho;
    let total = [s[0] * s[0], s[1] * s[1] * kept, s[2] * s[2] * kept].map(|v| v / all);
    agree("total", &found.total, &found.total_error, &total, 0.02);
    let along = [s[0], s[1] + rho * s[2], s[2] + rho * s[1]].map(|v| v * v / all);
    agree("first", &found.first, &found.first_error, &along, 0.02);
}

/// The printed standard errors are the scatter over repetitions. The mean of 300 squares of a standard normal variable has
/// the standard deviation √(2 / 300); the errors themselves are known to a tenth from 50 groups, which adds 3 %.
#[test]
fn standard_errors_are_the_scatter() {
    const COUNT: u64 = 300;
    let inputs = Independent(vec![Distribution::Uniform([0.0, 1.0]); 2]);
    let evaluate = |points: &Matrix| {
        let f = |x: &[f64]| 3.0 * x[0] + x[1] + 2.0 * (x[0] - 0.5) * (x[1] - 0.5);
        Matrix::from_vec(points.rows(), 1, points.iter_rows().map(f).collect())
    };
    let (main, minor, both) = (9.0 / 12.0, 1.0 / 12.0, 4.0 / 144.0);
    let all = main + minor + both;
    let truths = [main, minor, main + both, main + 0.5 * both].map(|part| part / all);
    let mut squares = [0.0; 4];
    for seed in 0..COUNT {
        let found = indices(&inputs, 1000, &Stream::root(7).at(seed), evaluate, |_, _| ());
        let estimates = [
            (found.first[(0, 0)], found.first_error[(0, 0)]),
            (found.first[(0, 1)], found.first_error[(0, 1)]),
            (found.total[(0, 0)], found.total_error[(0, 0)]),
            (found.shapley[(0, 0)], found.shapley_error[(0, 0)]),
        ];
        for ((square, truth), (value, error)) in squares.iter_mut().zip(truths).zip(estimates) {
            *square += ((value - truth) / error).powi(2) / COUNT as f64;
        }
    }
    for square in squares {
        assert!((square - 1.03).abs() < 4.0 * (2.0 / COUNT as f64).sqrt(), "{squares:?}");
    }
}

#[test]
fn one_input_has_everything_and_a_constant_nothing() {
    let inputs = Independent(vec![Distribution::Uniform([0.0, 1.0])]);
    let found = of(&inputs, 2000, |x| 1e6 + x[0]);
    agree("total", &found.total, &found.total_error, &[1.0], 0.1);
    assert_eq!(found.shapley[(0, 0)], 1.0);
    let constant = of(&inputs, 100, |_| 0.1);
    assert!(constant.first[(0, 0)].is_nan() && constant.shapley[(0, 0)].is_nan());
    assert_eq!([evaluations(1, true, 10), evaluations(3, true, 10)], [20, 60]);
}
