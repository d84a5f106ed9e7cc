//! Fits under designs that are not uniform, against closed forms.

use lacuna::math::distribution::Distribution;
use lacuna::plugin::forward::Linear;
use lacuna::plugin::{Emulator, Forward};
use lacuna_linalg::{Matrix, multiply_vector, vector};

use super::bench::{fitted_to, latin_hypercube, of_degree, parameters_of, sobol};
use crate::surrogates::polynomial_chaos::{Expansion, Family, PolynomialChaos, Solver};

fn points(laws: &[Distribution], unit: &Matrix) -> Matrix {
    Matrix::from_fn(unit.rows(), unit.columns(), |i, j| laws[j].quantile(unit[(i, j)]))
}

fn fit(
    options: &PolynomialChaos,
    laws: &[Distribution],
    n: usize,
    response: impl Fn(&[f64]) -> f64,
) -> Expansion {
    let points = points(laws, &latin_hypercube(n, laws.len(), 3));
    let responses = Matrix::from_fn(n, 1, |i, _| response(points.row(i)));
    fitted_to(options, &parameters_of(laws), &points, &responses).unwrap()
}

fn all_laws() -> Vec<Distribution> {
    vec![
        Distribution::Uniform([1.0, 3.0]),
        Distribution::Normal([5.0, 0.2]),
        Distribution::Exponential(2.0),
        Distribution::Gamma([2.5, 1.0]),
        Distribution::Beta([2.0, 3.0, -1.0, 1.0]),
        Distribution::LogNormal([0.0, 0.3]),
        Distribution::LogUniform([0.5, 4.0]),
        Distribution::HalfNormal(2.0),
        Distribution::TruncatedNormal([0.0, 1.0, -1.0, f64::INFINITY]),
        Distribution::StudentT([12.0, 1.0, 0.5]),
        Distribution::InverseGamma([12.0, 20.0]),
        Distribution::Triangular([0.0, 1.0, 4.0]),
    ]
}

/// For `y = sum a_i x_i + b x_0 x_1` with independent parameters, mean and variance follow from those of the parts.
#[test]
fn moments_and_indices_of_sums_have_their_closed_forms_under_every_law() {
    let laws = all_laws();
    let weight = |i: usize| 1.0 + i as f64 / 4.0;
    let response =
        |x: &[f64]| (0..laws.len()).map(|i| weight(i) * x[i]).sum::<f64>() + 0.5 * x[0] * x[1];
    let expansion = fit(&of_degree(2), &laws, 160, response);
    let (m0, m1) = (laws[0].mean(), laws[1].mean());
    let (v0, v1) = (laws[0].variance(), laws[1].variance());
    let slope = |i: usize| match i {
        0 => weight(0) + 0.5 * m1,
        1 => weight(1) + 0.5 * m0,
        _ => weight(i),
    };
    let parts: Vec<f64> =
        laws.iter().enumerate().map(|(i, law)| slope(i).powi(2) * law.variance()).collect();
    let pair = 0.25 * v0 * v1;
    let variance = parts.iter().sum::<f64>() + pair;
    let mean: f64 = laws.iter().enumerate().map(|(i, law)| weight(i) * law.mean()).sum();
    let found = expansion.sensitivity().unwrap();
    assert!((found.mean[0] / (mean + 0.5 * m0 * m1) - 1.0).abs() < 1e-10);
    assert!((found.variance[0] / variance - 1.0).abs() < 1e-9);
    for (i, part) in parts.iter().enumerate() {
        assert!((found.outputs.first[(0, i)] - part / variance).abs() < 1e-9, "{}", laws[i]);
    }
    assert!((found.outputs.pairs[(0, 0)] - pair / variance).abs() < 1e-9);
    assert!((found.outputs.total[(0, 0)] - (parts[0] + pair) / variance).abs() < 1e-9);
}

/// The lognormal response `exp(s z)` of a normal parameter has the coefficients `exp(s^2/2) s^n / sqrt(n!)`.
#[test]
fn the_exponential_has_its_hermite_coefficients() {
    let laws = [Distribution::Normal([3.0, 0.5])];
    for basis in [Family::Auto, Family::Arbitrary] {
        let options = PolynomialChaos { basis, solver: Solver::LeastSquares, ..of_degree(11) };
        let expansion = fit(&options, &laws, 200, |x| (0.4 * (x[0] - 3.0) / 0.5).exp());
        for (t, c) in expansion.coefficients().column(0).iter().enumerate() {
            let n = expansion.terms().term(t)[0];
            let factorial: f64 = (1..=n).map(f64::from).product();
            let expected = 0.08_f64.exp() * 0.4_f64.powi(i32::from(n)) / factorial.sqrt();
            assert!((c - expected).abs() < 1e-7, "{n}: {c} {expected}");
        }
    }
}

#[test]
fn a_polynomial_in_the_logarithm_is_found_in_few_terms() {
    for (law, basis) in [
        (Distribution::LogUniform([1e-3, 10.0]), Family::Legendre),
        (Distribution::LogNormal([1.0, 2.0]), Family::Hermite),
    ] {
        let options = PolynomialChaos { basis, ..of_degree(3) };
        let fit = fit(&options, &[law], 20, |x| 1.0 + x[0].ln().powi(3));
        assert!(fit.fit_error().relative[0] < 1e-20, "{:?}", fit.fit_error().relative);
    }
}

#[test]
fn every_family_emulates_saves_and_has_its_gradient() {
    let laws = all_laws();
    for pair in laws.windows(2) {
        for basis in [
            Family::Auto,
            Family::Legendre,
            Family::Hermite,
            Family::Laguerre,
            Family::Jacobi,
            Family::Arbitrary,
        ] {
            let scale: Vec<f64> = pair.iter().map(Distribution::sd).collect();
            let response = |x: &[f64]| (0.3 * x[0] / scale[0] + 0.2 * x[1] / scale[1]).sin();
            let options = PolynomialChaos { basis, ..of_degree(5) };
            let fit = fit(&options, pair, 150, response);
            let error = fit.fit_error().relative[0];
            assert!(
                error < if basis == Family::Auto { 0.05 } else { 0.4 },
                "{basis:?} {} {}: {error}",
                pair[0],
                pair[1]
            );
            let again = Expansion::from_bytes(&fit.save().unwrap()).unwrap();
            assert_eq!(again, fit);
            let point = [pair[0].quantile(0.4), pair[1].quantile(0.7)];
            let jacobian = fit.jacobian(&point);
            for i in 0..2 {
                let step = 1e-5 * scale[i];
                let at = |sign: f64| {
                    let mut p = point;
                    p[i] += sign * step;
                    fit.mean(&Matrix::from_rows(2, [p]))[(0, 0)]
                };
                let slope = (at(1.0) - at(-1.0)) / (2.0 * step);
                assert!(((jacobian[(0, i)] - slope) * scale[i]).abs() < 1e-6);
            }
            let wild = Matrix::from_rows(2, [[-1e9, 1e9], [0.0, 0.0]]);
            assert!(fit.mean(&wild).as_slice().iter().all(|y| y.is_finite()));
            assert!(fit.jacobian(wild.row(0)).as_slice().iter().all(|y| y.is_finite()));
        }
    }
}

#[test]
fn sums_of_squares_of_hermite_expansions_are_those_of_the_product() {
    let laws = [Distribution::Normal([3.0, 0.5]), Distribution::Uniform([0.0, 2.0])];
    let response = |x: &[f64]| (x[0] + 3.0 * x[1]).sin() + x[0] * x[1];
    let expansion = fit(&of_degree(8), &laws, 200, response);
    let terms = expansion.terms().len();
    let factor = Matrix::from_fn(terms + 60, terms + 1, |i, j| ((7 * i + 3 * j) as f64).sin());
    let squares = expansion.sum_of_squares(&factor).unwrap();
    let points = points(&laws, &sobol(60, 2));
    for point in points.iter_rows().filter(|p| squares.covers(p)) {
        let one = Matrix::from_rows(2, [point]);
        let psi = expansion.basis(&one);
        let product = multiply_vector(&factor, &[psi.row(0), &[1.0]].concat());
        let plain = vector::dot(&product, &product);
        assert!((squares.values(&one)[0] - plain).abs() < 1e-11 * plain.max(1.0) + squares.error());
    }
    assert!(squares.covers(&[3.0, 1.0]) && !squares.covers(&[4.6, 1.0]));
    let laguerre = [Distribution::Exponential(1.0)];
    let expansion = fit(&of_degree(8), &laguerre, 60, |x| (-x[0]).exp());
    assert!(expansion.sum_of_squares(&Matrix::zeros(9, expansion.terms().len() + 1)).is_none());
}
