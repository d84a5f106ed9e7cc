//! Closed forms: a linear model, two normal distributions, textbook designs; and planted cases.
#![allow(clippy::unwrap_used)]

mod planted;

use lacuna::math::random::Stream;
use lacuna::text::values::Fraction;
use lacuna_linalg::Matrix;

use planted::{CURVES, FORMS, TIMES, world};

use super::choice::{Choice, Taken};
use super::hypothesis::Hypothesis;
use super::information::{Bits, Predicted, bits};
use super::quantity::Linear;
use super::{Wanted, Wish, next};
use crate::gap::experiment::ErrorShares;
use crate::gap::search::Explanation;
use crate::gap::system::System;
use crate::gap::system::fit::fit;
use crate::gap::system::whitener::Whitener;
use crate::study::gap::next::{NextKeys, QuantityKeys, Reduction};

fn known(mean: f64) -> Predicted {
    Predicted {
        mean: vec![mean],
        slopes: Matrix::zeros(1, 1),
        precision: Matrix::from_vec(1, 1, vec![1.0]),
    }
}

fn name_bits(d: f64, seed: u64) -> Bits {
    bits(&[0.5, 0.5], &[known(0.0), known(d)], None, &Stream::root(seed)).unwrap().name
}

/// The information on which of two normal distributions of distance `d` data come from, by the trapezoidal rule.
fn by_quadrature(d: f64) -> f64 {
    let log2 = |x: f64| x.ln() / std::f64::consts::LN_2;
    let step = 1e-3;
    let one = |i: i32| {
        let x = f64::from(i) * step;
        let (p, q) = ((-0.5 * x * x).exp(), (-0.5 * (x - d).powi(2)).exp());
        let share = |a: f64, b: f64| if a > 0.0 { 0.5 * a * log2(2.0 * a / (a + b)) } else { 0.0 };
        (share(p, q) + share(q, p)) / (2.0 * std::f64::consts::PI).sqrt() * step
    };
    (-12_000..20_000).map(one).sum()
}

#[test]
fn bits_on_the_name_of_two_normal_distributions_are_those_of_quadrature() {
    for (k, d) in [0.5, 1.0, 2.0, 4.0].into_iter().enumerate() {
        let (found, exact) = (name_bits(d, k as u64), by_quadrature(d));
        assert!((found.value - exact).abs() < 4.0 * found.error, "{d}: {} {exact}", found.value);
        assert!(found.error < 0.02);
    }
}

/// Of 200 estimates, those within two standard errors of quadrature are 95 %, to three standard errors of that count.
#[test]
fn the_standard_error_holds_as_often_as_it_says() {
    let exact = by_quadrature(1.5);
    let off = (0..200)
        .map(|seed| name_bits(1.5, seed))
        .filter(|own| (own.value - exact).abs() < 2.0 * own.error);
    let count = off.count() as f64;
    let error = (200.0_f64 * 0.9545 * 0.0455).sqrt();
    assert!((count - 190.9).abs() < 3.0 * error, "{count}");
}

/// Data `y` of mean `a` or `-a`, and a quantity `g` of mean `b` or `-b` that depends on the data by the hypothesis alone.
/// The joint density is summed on a grid.
fn joint_by_quadrature(a: f64, b: f64) -> f64 {
    let normal = |x: f64| (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let step = 0.02;
    let grid = || (-400..=400).map(|i| f64::from(i) * step);
    let mut sum = 0.0;
    for y in grid() {
        let (p, q) = (normal(y - a), normal(y + a));
        for g in grid() {
            let (r, s) = (normal(g - b), normal(g + b));
            let both = 0.5 * (p * r + q * s);
            let apart = 0.25 * (p + q) * (r + s);
            if both > 1e-300 {
                sum += both * (both / apart).log2() * step * step;
            }
        }
    }
    sum
}

#[test]
fn bits_on_a_quantity_are_those_of_quadrature() {
    for (k, [a, b]) in [[1.0, 1.0], [2.0, 0.5], [0.7, 3.0]].into_iter().enumerate() {
        let quantity = |value: f64| Linear { value, slopes: vec![1.0] };
        let all = [known(a), known(-a)];
        let on = [quantity(b), quantity(-b)];
        let found = bits(&[0.5, 0.5], &all, Some(&on), &Stream::root(40 + k as u64)).unwrap();
        let (own, exact) = (found.quantity.unwrap(), joint_by_quadrature(a, b));
        assert!((own.value - exact).abs() < 4.0 * own.error, "{a} {b}: {} {exact}", own.value);
        assert!(own.error < 0.03);
    }
}

/// `0.5 log2(1 + s^2 / sigma^2)` for one value of noise `sigma` and a prior of width `s`.
#[test]
fn bits_on_the_parameter_of_a_linear_model_have_their_closed_form() {
    for ratio in [0.3_f64, 1.0, 5.0] {
        let own = linear(1, Matrix::from_vec(1, 1, vec![1.0]));
        let new = Predicted {
            mean: vec![0.0],
            slopes: Matrix::from_vec(1, 1, vec![ratio]),
            precision: own.precision.clone(),
        };
        let exact = 0.5 * (1.0 + ratio * ratio).log2();
        assert!((own.parameter_bits(&new).unwrap() - exact).abs() < 1e-12);
        let on = [Linear { value: 0.0, slopes: vec![3.0] }];
        let found = bits(&[1.0], &[new], Some(&on), &Stream::root(9)).unwrap().quantity.unwrap();
        assert!((found.value - exact).abs() < 1e-9, "{} {exact}", found.value);
    }
}

/// A parameter of prior variance 1 was measured once, with noise of variance 1 and an emulator's error of variance 1: its
/// variance is `2 / 3`. If runs leave the share `1 - k` of the variance of that error, it is `(2 - k) / (3 - k)`.
#[test]
fn bits_of_further_runs_have_their_closed_form() {
    let precision = Matrix::from_fn(2, 2, |i, j| if i == j { 2.0 } else { 1.0 });
    let own = Hypothesis { errors: vec![0.5], first_error: 1, ..linear(1, precision) };
    for factor in [0.9_f64, 0.5, 0.1] {
        let origins = vec![ErrorShares { emulator: 1.0, numerics: 0.0 }];
        let taken = Taken::Errors { emulator: factor, numerics: 1.0, origins };
        let choice = Choice { name: String::new(), cost: 1.0, taken };
        let k = 1.0 - factor * factor;
        let exact = 0.5 * ((2.0 / 3.0) / ((2.0 - k) / (3.0 - k))).log2();
        let found = own.parameter_bits(&choice.predicted(&own, &own)).unwrap();
        assert!((found - exact).abs() < 1e-12, "{found} {exact}");
    }
}

/// A hypothesis of this precision without data.
fn linear(parameters: usize, precision: Matrix) -> Hypothesis {
    let unknowns = precision.rows();
    Hypothesis {
        response: vec![0.0],
        tangents: Matrix::zeros(unknowns, 1),
        precision,
        parameters,
        first_error: unknowns,
        errors: Vec::new(),
    }
}

/// The places at which a model with these derivatives is measured next, after none or one: those with most bits.
fn best_places<const N: usize>(
    places: &[[f64; N]],
    precision: &Matrix,
    slopes: impl Fn(usize, f64) -> f64,
) -> [f64; N] {
    let own = linear(precision.rows(), precision.clone());
    let mut best = (f64::NEG_INFINITY, places[0]);
    for &at in places {
        let slopes = Matrix::from_fn(precision.rows(), N, |j, i| slopes(j, at[i]));
        let new = Predicted { mean: vec![0.0; N], slopes, precision: precision.clone() };
        let bits = own.parameter_bits(&new).unwrap();
        if bits > best.0 {
            best = (bits, at);
        }
    }
    best.1
}

/// A weak prior.
fn weak(n: usize) -> Matrix {
    Matrix::from_fn(n, n, |i, j| if i == j { 1e-6 } else { 0.0 })
}

/// The D-optimal design of a quadratic regression on [-1, 1] has equal weights at -1, 0 and 1 (Fedorov, Theory of Optimal
/// Experiments, 1972).
#[test]
fn the_best_three_places_of_a_quadratic_regression_are_its_d_optimal_design() {
    let places: Vec<f64> = (-10..=10).map(|i| f64::from(i) / 10.0).collect();
    let increasing = |a: f64| places.iter().copied().filter(move |b| *b > a);
    let triples: Vec<[f64; 3]> = places
        .iter()
        .flat_map(|&a| increasing(a).flat_map(move |b| increasing(b).map(move |c| [a, b, c])))
        .collect();
    let best = best_places(&triples, &weak(3), |j, x| x.powi(j as i32));
    assert_eq!(best, [-1.0, 0.0, 1.0]);
}

/// The locally D-optimal design of Michaelis and Menten's law `v x / (k + x)` on `[0, x1]` has equal weights at `x1` and at
/// `k x1 / (2 k + x1)` (Bates and Watts, Nonlinear Regression Analysis and Its Applications, 1988, section 3.14; Duggleby,
/// Journal of Theoretical Biology 81 (1979) 671).
#[test]
fn the_best_two_places_of_a_saturating_law_are_its_d_optimal_design() {
    let (v, k, x1) = (212.7, 0.064_12, 1.1);
    let places: Vec<f64> = (1..=1100).map(|i| f64::from(i) * 1e-3).collect();
    let pairs: Vec<[f64; 2]> = places.iter().map(|&x| [x, x1]).collect();
    let slope = |j: usize, x: f64| {
        if j == 0 { x / (k + x) } else { -v * x / (k + x).powi(2) }
    };
    let best = best_places(&pairs, &weak(2), slope);
    assert!((best[0] - k * x1 / (2.0 * k + x1)).abs() < 1e-3, "{best:?}");
}

/// The default options, where nothing was measured so far, and a quantity there.
#[test]
fn options_reach_where_nothing_was_measured() {
    let strong = [1.0; CURVES];
    let own = world(FORMS[0], &strong);
    let truth = own.response(&[0.3, 1.0]);
    let mut experiment = own.experiment(&truth, 2, &Stream::root(5));
    // Condition `y` and sensor `d` have no data.
    for condition in &mut experiment.conditions {
        let is_second = condition.scenario.as_deref() == Some("y");
        for replicate in &mut condition.replicates {
            replicate.iter_mut().enumerate().for_each(|(i, value)| {
                if is_second || i / TIMES == 3 {
                    *value = None;
                }
            });
        }
    }
    let experiment = experiment.remeasured();
    let (_, means) = experiment.means();
    let whitener = Whitener::new(&experiment, &own.noise, &means);
    let system = System::new(&experiment, Vec::new());
    let best = fit(&system, &whitener, &means, &[0.0, 0.0]);
    let one = [("x".to_owned(), 1.0, Explanation::exact(&system, &best))];
    let keys = QuantityKeys {
        scenarios: vec!["y".to_owned()],
        on: [("sensor".to_owned(), vec!["d".to_owned()])].into(),
        of: Reduction::Largest,
        ..QuantityKeys::default()
    };
    let wish = Wish { options: &[], quantity: Some(&keys), runs: 0 };
    let found = next(&one, &own.noise, wish, &Stream::root(6)).unwrap();
    assert_eq!(found.ranked_by, Wanted::Quantity);
    let names: Vec<&str> = found.options.iter().map(|own| own.name.as_str()).collect();
    assert_eq!(names.len(), 2 * (1 + 2 + 4), "{names:?}");
    let bits = |name: &str| {
        let option = found.options.iter().find(|own| own.name == name).unwrap();
        (option.parameter_bits, option.quantity_bits.unwrap(), option.quantity_error.unwrap())
    };
    // The new condition is like the old one: as many bits from the three sensors that have data, if they are measured there.
    let (old, new) = (bits("1 replicate under `x`"), bits("1 replicate under `y`"));
    assert!((old.0 - new.0).abs() < 1e-9, "{old:?} {new:?}");
    assert!((old.1 - new.1).abs() < 1e-9 && old.2 == 0.0, "{old:?} {new:?}");
    // More data tell more.
    assert!(bits("4 replicates under `y`").0 > new.0);
    // A sensor that no scenario has is named, and the others are weighed.
    let nowhere = [("sensor".to_owned(), vec!["elsewhere".to_owned()])].into();
    let options = [NextKeys { on: nowhere, ..NextKeys::default() }, NextKeys::default()];
    let wish = Wish { options: &options, quantity: None, runs: 0 };
    let found = next(&one, &own.noise, wish, &Stream::root(6)).unwrap();
    assert_eq!(found.without_data, ["1 replicate on sensor elsewhere"]);
    assert_eq!(found.options.len(), 1);
}

/// An error that the surrogate has and further runs make smaller: without any such error, runs tell nothing.
#[test]
fn runs_tell_nothing_without_an_error_of_the_surrogate() {
    let own = world(FORMS[0], &[1.0; CURVES]);
    let truth = own.response(&[0.3, 1.0]);
    let experiment = own.experiment(&truth, 2, &Stream::root(7));
    let (_, means) = experiment.means();
    let whitener = Whitener::new(&experiment, &own.noise, &means);
    let system = System::new(&experiment, Vec::new());
    let best = fit(&system, &whitener, &means, &[0.0, 0.0]);
    let one = [("x".to_owned(), 1.0, Explanation::exact(&system, &best))];
    let half = Fraction::new(0.5).unwrap();
    let options = [NextKeys { emulator_error: Some(half), ..NextKeys::default() }];
    let wish = Wish { options: &options, quantity: None, runs: 100 };
    let found = next(&one, &own.noise, wish, &Stream::root(8)).unwrap();
    assert_eq!(found.options[0].name, "error of the surrogate times 0.5");
    assert!(found.options[0].parameter_bits.abs() < 1e-12);
}
