//! Against ArviZ and against exact predictions.

use super::*;
use crate::math::random::{Stream, normal};
use crate::math::special::HALF_LN_TWO_PI;

/// Log densities with heavy tails: a squared misfit of logistic quantiles in mixed order.
fn densities(draws: usize, data: usize, shift: f64, spread: f64) -> Matrix {
    Matrix::from_fn(draws, data, |s, i| {
        let p = (((s * 73 + i * 29) % draws) as f64 + 0.5) / draws as f64;
        let misfit = (1.7 * i as f64).cos() * 1.5 + shift - 0.5 * (p / (1.0 - p)).ln();
        -0.5 * misfit * misfit * (0.1 + spread * i as f64 / data as f64) - 0.3
    })
}

#[test]
#[allow(clippy::unreadable_literal)]
fn the_figures_are_those_of_arviz() {
    // Source: ArviZ 0.23.4, arviz.loo(..., reff=1): elpd_loo, se, p_loo, the number of shapes above 0.7,
    // and loo_i and pareto_k of the fourth datum.
    for (sizes, elpd, error, parameters, unreliable, fourth, k) in [
        (
            (400, 12, 0.0, 0.5),
            -9.565061594698932,
            1.3650550898280214,
            2.758123168854442,
            3,
            -0.45228007137957693,
            0.442815333659226,
        ),
        (
            (1000, 30, 0.3, 2.0),
            -154.773435788271,
            24.83595690359406,
            127.26560546524314,
            25,
            -0.6106091259887343,
            0.566715202756176,
        ),
    ] {
        let found = LeaveOneOut::of(&densities(sizes.0, sizes.1, sizes.2, sizes.3));
        for (what, a, b) in [
            ("elpd", found.elpd, elpd),
            ("error", found.error, error),
            ("parameters", found.parameters, parameters),
            ("fourth", found.data[3].elpd, fourth),
            ("k", found.data[3].k_hat, k),
        ] {
            assert!((a - b).abs() < 1e-9 * b.abs(), "{what}: {a} and {b}");
        }
        assert_eq!(found.unreliable, unreliable);
    }
}

#[test]
#[allow(clippy::unreadable_literal)]
fn the_difference_is_that_of_arviz() {
    // Source: ArviZ 0.23.4, arviz.compare: elpd_diff and dse.
    let a = LeaveOneOut::of(&densities(400, 12, 0.0, 0.5));
    let b = LeaveOneOut::of(&densities(400, 12, 1.5, 0.6));
    let found = compare(&a, &b).unwrap();
    assert!((found.elpd - 11.11588277360963).abs() < 1e-8, "{found:?}");
    assert!((found.error - 4.970052470684986).abs() < 1e-8, "{found:?}");
    let back = compare(&b, &a).unwrap();
    assert!(back.elpd == -found.elpd && (back.error - found.error).abs() < 1e-12);
    let message = compare(&a, &LeaveOneOut::of(&densities(400, 11, 0.0, 0.5))).unwrap_err();
    assert!(message.contains("of 12 and of 11 data"), "{message}");
}

#[test]
fn left_out_normal_data_have_their_exact_predictions() {
    // n normal data of variance one with a flat prior on their mean: the posterior is N(mean, 1 / n), and a datum
    // given the others is N(mean of those, 1 + 1 / (n - 1)).
    let (n, draws) = (20, 8000);
    let mut rng = Stream::root(1).generator();
    let data: Vec<f64> = (0..n).map(|_| normal(&mut rng)).collect();
    let centre = mean(&data);
    let means: Vec<f64> =
        (0..draws).map(|_| centre + normal(&mut rng) / (n as f64).sqrt()).collect();
    let law = |x: f64, mean: f64, variance: f64| {
        -0.5 * (x - mean).powi(2) / variance - 0.5 * variance.ln() - HALF_LN_TWO_PI
    };
    let found = LeaveOneOut::of(&Matrix::from_fn(draws, n, |s, i| law(data[i], means[s], 1.0)));
    let others = n as f64 - 1.0;
    for (left, &x) in found.data.iter().zip(&data) {
        let exact = law(x, (centre * n as f64 - x) / others, 1.0 + 1.0 / others);
        // The ratio varies by less than half over the posterior: 8000 draws give three digits.
        assert!((left.elpd - exact).abs() < 0.02, "{} and {exact}", left.elpd);
    }
    assert!((found.parameters - 1.0).abs() < 0.5 && found.unreliable == 0, "{found:?}");
}

#[test]
fn data_without_a_value_are_unreliable() {
    let mut densities = densities(400, 3, 0.0, 0.0);
    assert_eq!(LeaveOneOut::of(&densities).unreliable, 0);
    densities[(7, 1)] = f64::NEG_INFINITY;
    assert_eq!(LeaveOneOut::of(&densities).unreliable, 1);
}
