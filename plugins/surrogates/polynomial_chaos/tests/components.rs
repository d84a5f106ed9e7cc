//! Principal components of the outputs.

use lacuna::plugin::forward::Linear;
use lacuna::plugin::{Emulator, Forward};
use lacuna_linalg::{Matrix, multiply, multiply_transposed};

use super::bench::{fitted, latin_hypercube, of_degree, scaled, up_to};
use crate::surrogates::polynomial_chaos::{Basis, Expansion, PolynomialChaos, Solver};
use crate::surrogates::principal_components::Components;

const BOX: [[f64; 2]; 2] = [[0.0, 2.0], [5.0, 6.0]];

fn response(x: &[f64], output: usize) -> f64 {
    let t = output as f64 / 20.0;
    if output == 3 { 1.5 } else { (2.0 * x[0] * t).sin() + x[1] * t + (-t * x[0] * x[1]).exp() }
}

fn runs(n: usize, seed: u64) -> (Matrix, Matrix) {
    let unit = latin_hypercube(n, 2, seed);
    (scaled(&unit, &BOX), Matrix::from_fn(n, 40, |i, o| response(unit.row(i), o)))
}

/// With the same terms for all outputs a fit of all components equals the fit of the outputs, because least squares
/// is linear.
#[test]
fn all_components_are_all_outputs() {
    let (points, responses) = runs(80, 1);
    let plain = PolynomialChaos { solver: Solver::LeastSquares, ..of_degree(5) };
    let reduced = PolynomialChaos { components: Some(Components::Count(40)), ..plain.clone() };
    let plain = fitted(&plain, &BOX, &points, &responses).unwrap();
    let reduced = fitted(&reduced, &BOX, &points, &responses).unwrap();
    let close = |a: &Matrix, b: &Matrix, tolerance: f64| {
        a.as_slice().iter().zip(b.as_slice()).all(|(x, y)| (x - y).abs() < tolerance)
    };
    assert!(close(plain.coefficients(), reduced.coefficients(), 1e-11));
    assert!(close(&plain.fit_error().residuals, &reduced.fit_error().residuals, 1e-11));
    for (a, b) in plain.fit_error().relative.iter().zip(&reduced.fit_error().relative) {
        assert!(*a == *b || (a / b - 1.0).abs() < 1e-4, "{a} {b}");
    }
}

#[test]
fn what_components_leave_out_is_part_of_the_error() {
    let (points, responses) = runs(100, 2);
    let components = Some(Components::Count(2));
    let options = PolynomialChaos { components, ..up_to(1, 8) };
    let fit = fitted(&options, &BOX, &points, &responses).unwrap();
    let found = Components::Count(2).of(&responses).unwrap();
    let truncation = found.truncation;
    let residuals = &fit.fit_error().residuals;
    for (o, &left) in truncation.iter().enumerate() {
        let mean_square = residuals.column(o).iter().map(|r| r * r).sum::<f64>() / 100.0;
        assert!(mean_square >= 0.9 * left, "{o}: {mean_square} {left}");
    }
    let (fresh, truth) = runs(400, 3);
    let emulated = fit.mean(&fresh);
    let errors = |o: usize| (0..400).map(move |i| (i, o));
    for o in (0..40).filter(|&o| truncation[o] > 1e-6) {
        let square: f64 = errors(o).map(|k| (truth[k] - emulated[k]).powi(2)).sum::<f64>() / 400.0;
        let own = residuals.column(o).iter().map(|r| r * r).sum::<f64>() / 100.0;
        assert!((0.5..2.0).contains(&(square / own)), "{o}: {square} {own}");
    }
    assert_eq!(fit.fit_error().relative[3], 0.0);
    assert!((fit.mean(&fresh)[(0, 3)] - 1.5).abs() < 1e-12);
    let left_out = fit.summary().reduction.unwrap().left_out;
    assert!((0.0..0.1).contains(&left_out) && left_out > 0.0);
    assert!(fit.facts().iter().any(|f| f.name == "principal components" && f.value == "2"));
    assert_eq!(Expansion::from_bytes(&fit.save().unwrap()).unwrap(), fit);
    let product = multiply(&fit.basis(&points), fit.coefficients());
    assert_eq!(product, fit.mean(&points));
}

#[test]
fn outputs_that_do_not_vary_have_no_component() {
    let (points, _) = runs(30, 4);
    let responses = Matrix::from_fn(30, 3, |_, o| o as f64);
    let components = Some(Components::Variance(0.99));
    let options = PolynomialChaos { components, ..up_to(1, 3) };
    let fit = fitted(&options, &BOX, &points, &responses).unwrap();
    assert_eq!(fit.mean(&points).row(7), [0.0, 1.0, 2.0]);
    assert_eq!(fit.fit_error().relative, [0.0; 3]);
}

/// With many runs of many outputs components are the default, and what they leave out is less than the error of the fit.
#[test]
fn many_runs_of_many_outputs_have_components_by_default() {
    let of = |n: usize| {
        let unit = latin_hypercube(n, 2, 5);
        let responses = Matrix::from_fn(n, 1000, |i, o| response(unit.row(i), o % 40));
        fitted(&of_degree(3), &BOX, &scaled(&unit, &BOX), &responses).unwrap()
    };
    assert!(of(1000).summary().reduction.is_none());
    let outputs = PolynomialChaos { components: Some(Components::None), ..of_degree(3) };
    let unit = latin_hypercube(1001, 2, 5);
    let responses = Matrix::from_fn(1001, 1000, |i, o| response(unit.row(i), o % 40));
    let each = fitted(&outputs, &BOX, &scaled(&unit, &BOX), &responses).unwrap();
    assert!(each.summary().reduction.is_none());
    let many = of(1001);
    let reduction = many.summary().reduction.unwrap();
    assert!(reduction.components <= 64, "{reduction:?}");
    let error = many.fit_error().relative.iter().sum::<f64>() / 1000.0;
    assert!(reduction.left_out <= 0.02 * error, "{reduction:?} {error}");
}

/// Few components for many terms stay as they are. Their expansion in all terms has the same response, slopes and
/// moments, and sums of squares have the same values, because both are the same linear combinations in another order.
#[test]
fn combinations_of_components_equal_the_expansion_in_all_terms() {
    let (points, responses) = runs(150, 6);
    let options = PolynomialChaos { components: Some(Components::Count(3)), ..up_to(1, 9) };
    let fit = fitted(&options, &BOX, &points, &responses).unwrap();
    let terms = fit.terms().len();
    assert_eq!(fit.coefficients().rows(), 4, "{terms} terms");
    let basis = Basis::new(fit.basis_coordinates(), fit.terms().clone());
    let expanded = fit.clone().with(basis, fit.of_terms().into_owned());
    assert_eq!(expanded.coefficients().rows(), terms);
    let (fresh, _) = runs(20, 7);
    let close = |a: &[f64], b: &[f64]| {
        let size = b.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        assert!(a.len() == b.len() && a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-11 * size));
    };
    close(fit.mean(&fresh).as_slice(), expanded.mean(&fresh).as_slice());
    close(fit.jacobian(fresh.row(3)).as_slice(), expanded.jacobian(fresh.row(3)).as_slice());
    let (own, all) = (fit.sensitivity().unwrap(), expanded.sensitivity().unwrap());
    close(&own.mean, &all.mean);
    close(&own.variance, &all.variance);
    for (a, b) in [(&own.outputs, &all.outputs), (&own.aggregated, &all.aggregated)] {
        close(a.first.as_slice(), b.first.as_slice());
        close(a.total.as_slice(), b.total.as_slice());
        close(a.pairs.as_slice(), b.pairs.as_slice());
    }
    let factor = Matrix::from_fn(5, 5, |i, j| ((3 * i + 7 * j) as f64).sin());
    if let Some(squares) = fit.sum_of_squares(&factor) {
        let functions = fit.basis(&fresh);
        let extended = Matrix::from_fn(20, 5, |i, j| if j < 4 { functions[(i, j)] } else { 1.0 });
        let product = multiply_transposed(&extended, &factor);
        let direct: Vec<f64> = product.iter_rows().map(|r| r.iter().map(|x| x * x).sum()).collect();
        close(&squares.values(&fresh), &direct);
    }
    // What is saved without combinations can be read, and a wrong number of them is damage.
    assert_eq!(Expansion::from_bytes(&expanded.save().unwrap()).unwrap(), expanded);
    let mut bytes = fit.save().unwrap();
    let at = bytes.windows(12).position(|w| w == b"\"combined\":4").unwrap();
    bytes[at + 11] = b'9';
    assert!(Expansion::from_bytes(&bytes).is_err());
}
