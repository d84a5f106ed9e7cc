//! More runs than terms are chosen on.

use lacuna::plugin::forward::Linear;
use lacuna::plugin::{Emulator, Forward};
use lacuna_linalg::{Matrix, least_squares};

use super::bench::{BOREHOLE, ISHIGAMI, fitted, latin_hypercube, scaled, up_to};
use crate::surrogates::polynomial_chaos::{PolynomialChaos, Selection};

/// Responses of Ishigami's function and a multiple of its square.
fn responses(points: &Matrix) -> Matrix {
    let value = |i: usize| (ISHIGAMI.value)(points.row(i));
    Matrix::from_fn(points.rows(), 2, |i, o| if o == 0 { value(i) } else { 1e3 + value(i).powi(2) })
}

fn design(runs: usize, seed: u64) -> Matrix {
    scaled(&latin_hypercube(runs, 3, seed), ISHIGAMI.ranges)
}

fn chosen_on(runs: usize) -> PolynomialChaos {
    PolynomialChaos { selection_runs: Some(runs), ..up_to(1, 12) }
}

fn error(fit: &impl Forward, output: usize) -> f64 {
    let points = design(1000, 99);
    let (truth, emulated) = (responses(&points).column(output), fit.mean(&points).column(output));
    let square: f64 = truth.iter().zip(&emulated).map(|(t, e)| (t - e).powi(2)).sum();
    (square / 1000.0).sqrt()
}

/// Coefficients and leave-one-out residuals are those of least squares with the chosen terms, computed here by leaving out
/// single runs.
#[test]
fn outputs_with_common_terms_are_least_squares() {
    let points = design(4000, 1);
    let data = responses(&points);
    let fit = fitted(&chosen_on(300), ISHIGAMI.ranges, &points, &data).unwrap();
    let part = fit.summary().part.unwrap();
    assert_eq!((part.runs, part.common), (300, true));
    let basis = fit.basis(&points);
    let all = least_squares(&basis, &data).unwrap().solution;
    for (a, b) in all.as_slice().iter().zip(fit.coefficients().as_slice()) {
        assert!((a - b).abs() < 1e-9 * (1.0 + a.abs()), "{a} {b}");
    }
    for run in [0, 17, 3999] {
        let others: Vec<usize> = (0..4000).filter(|&i| i != run).collect();
        let without = least_squares(&basis.select_rows(&others), &data.select_rows(&others))
            .unwrap()
            .solution;
        for o in 0..2 {
            let predicted: f64 =
                basis.row(run).iter().zip(without.column(o)).map(|(x, c)| x * c).sum();
            let residual = data[(run, o)] - predicted;
            let own = fit.fit_error().residuals[(run, o)];
            assert!((residual - own).abs() < 1e-8 * (1.0 + residual.abs()), "{residual} {own}");
        }
    }
}

/// With the default number of runs for the choice the error is at most 5 % larger than with the choice on all runs, and
/// the relative leave-one-out error agrees with the error at fresh points.
#[test]
fn terms_of_a_part_predict_as_well_as_those_of_all_runs() {
    let points = design(4000, 2);
    let data = responses(&points);
    let of_part = fitted(&up_to(1, 12), ISHIGAMI.ranges, &points, &data).unwrap();
    let of_all = fitted(&chosen_on(4000), ISHIGAMI.ranges, &points, &data).unwrap();
    assert!(of_all.summary().part.is_none());
    assert_eq!(of_part.summary().part.unwrap().runs, 2000);
    for o in 0..2 {
        let (a, b) = (error(&of_part, o), error(&of_all, o));
        assert!(a < 1.05 * b, "{o}: {a} {b}");
        let values = responses(&design(1000, 99)).column(o);
        let mean = values.iter().sum::<f64>() / 1000.0;
        let variance = values.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / 1000.0;
        let relative = a * a / variance;
        let stated = of_part.fit_error().relative[o];
        assert!((0.5..2.0).contains(&(stated / relative)), "{o}: {stated} {relative}");
    }
}

/// A response that no polynomial follows: the error that is stated is that at fresh points.
#[test]
fn the_error_of_a_step_is_stated() {
    let step = |points: &Matrix| {
        Matrix::from_fn(points.rows(), 1, |i, _| f64::from(u8::from(points[(i, 0)] > 1.0)))
    };
    let points = design(4000, 6);
    let fit = fitted(&chosen_on(500), ISHIGAMI.ranges, &points, &step(&points)).unwrap();
    assert!(fit.summary().part.unwrap().common);
    let fresh = design(1000, 98);
    let (truth, emulated) = (step(&fresh).column(0), fit.mean(&fresh).column(0));
    let square: f64 = truth.iter().zip(&emulated).map(|(t, e)| (t - e).powi(2)).sum();
    let mean = truth.iter().sum::<f64>() / 1000.0;
    let relative = square / 1000.0 / (mean * (1.0 - mean));
    let stated = fit.fit_error().relative[0];
    assert!(relative > 0.01, "{relative}");
    // A thousand points with a few hundred beside the step: the ratio is known to about a tenth.
    assert!((0.7..1.4).contains(&(stated / relative)), "{stated} {relative}");
}

/// By cross-validation the terms are chosen with parts of the runs of the choice.
#[test]
fn cross_validation_chooses_on_a_part_too() {
    let points = design(3000, 7);
    let options = PolynomialChaos { selection: Selection::KFold(5), ..chosen_on(300) };
    let fit = fitted(&options, ISHIGAMI.ranges, &points, &responses(&points)).unwrap();
    assert_eq!(fit.summary().part.unwrap().runs, 300);
    assert!(fit.fit_error().relative[0] < 1e-3, "{}", fit.fit_error().relative[0]);
    let more = PolynomialChaos { selection: Selection::KFold(400), ..chosen_on(300) };
    let stop = fitted(&more, ISHIGAMI.ranges, &points, &responses(&points)).unwrap_err();
    assert!(stop.message.contains("300 runs cannot be divided into 400 parts"), "{stop}");
}

/// With too few runs for all terms together each output keeps its own terms, with coefficients of all runs.
#[test]
fn few_runs_for_the_terms_of_all_keep_the_terms_of_each() {
    let points = scaled(&latin_hypercube(900, 8, 3), BOREHOLE.ranges);
    let data = Matrix::from_fn(900, 1, |i, _| (BOREHOLE.value)(points.row(i)));
    let options = PolynomialChaos { selection_runs: Some(400), ..up_to(1, 4) };
    let fit = fitted(&options, BOREHOLE.ranges, &points, &data).unwrap();
    let part = fit.summary().part.unwrap();
    assert_eq!((part.runs, part.common), (400, false));
    let own = least_squares(&fit.basis(&points), &data).unwrap().solution;
    for (a, b) in own.as_slice().iter().zip(fit.coefficients().as_slice()) {
        assert!((a - b).abs() < 1e-9 * (1.0 + a.abs()), "{a} {b}");
    }
}

/// An output that is constant over the part, but not over all runs, is fitted on all of them.
#[test]
fn outputs_that_vary_in_few_runs_are_not_lost() {
    let points = design(3000, 4);
    let step = |i: usize| f64::from(u8::from(points[(i, 0)] > 3.135));
    let varying = (0..3000).filter(|&i| step(i) > 0.0).count();
    assert!(varying > 0 && varying < 10);
    let data = Matrix::from_fn(3000, 2, |i, o| if o == 0 { step(i) } else { points[(i, 1)].sin() });
    let options = PolynomialChaos { selection_runs: Some(150), ..up_to(1, 12) };
    let fit = fitted(&options, ISHIGAMI.ranges, &points, &data).unwrap();
    assert_eq!(fit.summary().constant, 0);
    assert!(fit.fit_error().relative[0] > 0.1, "a step of few runs cannot be emulated well");
}

/// Results do not depend on the number of threads.
#[test]
fn common_terms_have_the_same_bits_with_any_number_of_threads() {
    let points = design(2500, 5);
    let data = responses(&points);
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fitted(&chosen_on(300), ISHIGAMI.ranges, &points, &data).unwrap())
    };
    assert_eq!(of(1), of(3));
}
