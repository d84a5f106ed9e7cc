//! Accuracy on published functions, compared with figures of another implementation.
//!
//! The bounds are the relative validation errors of a Python implementation of the same method (scikit-learn's path,
//! UQLab's selection) with one design each: unscrambled Sobol' points without the first, and one Latin hypercube. The
//! Sobol' designs have the same points here. The Latin hypercubes do not, so that the median of five is compared with
//! the single one.

use lacuna::plugin::Emulator;

use super::bench::{
    BOREHOLE, CIRCUIT, Function, ISHIGAMI, SOBOL_G, SOBOL_G_WEIGHTS, latin_hypercube, sobol, up_to,
};
use crate::surrogates::polynomial_chaos::{PolynomialChaos, QNorm, QNormRange};

/// Returns the validation error with the Sobol' design, and the median with five Latin hypercubes.
fn errors(function: &Function, options: &PolynomialChaos, n: usize) -> (f64, f64) {
    let d = function.dimension();
    let error = |unit| function.validation(&function.fit(options, &unit), 10_000);
    let mut latin: Vec<f64> = (0..5).map(|seed| error(latin_hypercube(n, d, seed))).collect();
    latin.sort_by(f64::total_cmp);
    (error(sobol(n, d)), latin[2])
}

fn check(function: &Function, options: &PolynomialChaos, bounds: &[(usize, f64, f64)]) {
    for &(n, sobol_bound, latin_bound) in bounds {
        let (sobol, latin) = errors(function, options, n);
        println!(
            "{n} runs: Sobol' {sobol:.1e} ({sobol_bound:.1e}), LHS {latin:.1e} ({latin_bound:.1e})"
        );
        assert!(sobol <= sobol_bound, "{n} Sobol' points: {sobol:e} above {sobol_bound:e}");
        assert!(latin <= latin_bound, "{n} points of a Latin hypercube: {latin:e}");
    }
}

#[test]
fn ishigami_is_as_accurate_as_elsewhere() {
    let bounds = [(100, 4.5e-5, 5.0e-6), (200, 1.7e-11, 1.3e-9), (603, 1.1e-11, 1.1e-11)];
    check(&ISHIGAMI, &PolynomialChaos::default(), &bounds);
}

#[test]
fn the_circuit_is_as_accurate_as_elsewhere() {
    let options = PolynomialChaos { max_terms: Some(1300), ..up_to(1, 8) };
    // The last bound: the published error is 1.3e-6 with one design; the five designs here give 0.95e-6 to 7.6e-6.
    check(&CIRCUIT, &options, &[(100, 3.4e-5, 2.5e-5), (200, 2.5e-6, 2.0e-6)]);
}

#[test]
fn the_borehole_is_as_accurate_as_elsewhere() {
    let options = PolynomialChaos { max_terms: Some(1300), ..up_to(1, 6) };
    check(&BOREHOLE, &options, &[(100, 3.4e-5, 1.2e-3), (200, 2.8e-5, 1.4e-4)]);
}

/// With adaptive norms too, as the table's figures were found; bounds of the Sobol' designs.
#[test]
fn every_row_of_the_table_is_reached_with_adapted_norms() {
    let q_norm = QNorm::Range(QNormRange::default());
    let options = PolynomialChaos {
        q_norm: Some(q_norm),
        max_terms: Some(1300),
        ..PolynomialChaos::default()
    };
    for (function, max, bounds) in [
        (CIRCUIT, 8, [3.4e-5, 2.5e-6, 1.3e-8]),
        (BOREHOLE, 6, [3.4e-5, 2.8e-5, 9.0e-7]),
        (SOBOL_G, 8, [2.3e-2, 1.4e-2, 8.7e-3]),
    ] {
        for (n, bound) in [100, 200, 603].into_iter().zip(bounds) {
            let options = PolynomialChaos { degree: up_to(1, max).degree, ..options.clone() };
            let fit = function.fit(&options, &sobol(n, function.dimension()));
            let error = function.validation(&fit, 20_000);
            println!("{n} runs of {} parameters: {error:.1e} ({bound:.1e})", function.dimension());
            assert!(error <= bound, "{n} runs of {} parameters: {error:e}", function.dimension());
        }
    }
}

#[test]
fn indices_of_the_g_function_are_near_their_closed_forms() {
    // Source: Saltelli and Sobol' (1995): the partial variances are products of 1 / (3 (1 + a_i)^2). The kinks
    // leave one per cent of the variance unexplained.
    let parts = SOBOL_G_WEIGHTS.map(|a| 1.0 / (3.0 * (1.0 + a).powi(2)));
    let variance = parts.iter().map(|v| 1.0 + v).product::<f64>() - 1.0;
    let q_norm = QNorm::Range(QNormRange::default());
    let options = PolynomialChaos { q_norm: Some(q_norm), ..up_to(1, 12) };
    let indices = SOBOL_G.fit(&options, &sobol(603, 8)).sensitivity().unwrap();
    for (i, v) in parts.iter().enumerate() {
        let others = parts.iter().map(|v| 1.0 + v).product::<f64>() / (1.0 + v);
        assert!((indices.outputs.first[(0, i)] - v / variance).abs() < 0.01);
        assert!((indices.outputs.total[(0, i)] - v * others / variance).abs() < 0.01);
    }
    assert!((indices.outputs.pairs[(0, 0)] - parts[0] * parts[1] / variance).abs() < 0.01);
    assert!((indices.mean[0] - 1.0).abs() < 0.01);
}

#[test]
fn moments_and_indices_of_ishigami_have_their_closed_forms() {
    // Source: Ishigami and Homma (1990); a = 7, b = 0.1.
    let (a, b, pi) = (7.0_f64, 0.1_f64, std::f64::consts::PI);
    let v1 = 0.5 * (1.0 + b * pi.powi(4) / 5.0).powi(2);
    let v2 = a * a / 8.0;
    let v13 = b * b * pi.powi(8) * 8.0 / 225.0;
    let v = v1 + v2 + v13;
    let expansion = ISHIGAMI.fit(&PolynomialChaos::default(), &sobol(300, 3));
    let (mean, variance) = expansion.mean_and_variance();
    assert!((mean[0] - a / 2.0).abs() < 1e-6 && (variance[0] / v - 1.0).abs() < 1e-6);
    let indices = expansion.sensitivity().unwrap();
    assert_eq!(indices.pairs, [[0, 1], [0, 2], [1, 2]]);
    for shares in [&indices.outputs, &indices.aggregated] {
        for (row, expected) in [
            (shares.first.row(0), [v1, v2, 0.0]),
            (shares.total.row(0), [v1 + v13, v2, v13]),
            (shares.pairs.row(0), [0.0, v13, 0.0]),
        ] {
            assert!(row.iter().zip(expected).all(|(s, e)| (s - e / v).abs() < 1e-6));
        }
    }
}

#[test]
fn the_leave_one_out_error_is_near_the_validation_error() {
    // Source of the factor: the measured table above has both within a factor of 2 for 100 runs and more; its single
    // designs are widened to 4 for five hypercubes.
    for seed in 0..5 {
        let fit = CIRCUIT.fit(&up_to(1, 4), &latin_hypercube(200, 6, seed));
        let ratio = fit.fit_error().relative[0] / CIRCUIT.validation(&fit, 10_000);
        assert!((0.25..4.0).contains(&ratio), "seed {seed}: {ratio}");
    }
}
