//! Leave-one-out predictions compared with ArviZ and with exact predictions.

use super::*;
use crate::math::random::{Stream, normal, permutation};
use crate::math::special::HALF_LN_TWO_PI;

/// Log densities with heavy tails: the squared misfit of logistic quantiles in mixed order.
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
    // Source: ArviZ 0.23.4, arviz.loo(..., reff=1): elpd_loo, se, p_loo, the number of shapes above 0.7, and loo_i and
    // pareto_k of the fourth datum.
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
        let found =
            LeaveOneOut::of(&densities(sizes.0, sizes.1, sizes.2, sizes.3), 1.0, Vec::new());
        for (what, a, b) in [
            ("elpd", found.elpd, elpd),
            ("error", found.error, error),
            ("parameters", found.parameters, parameters),
            ("fourth", found.data[3].elpd, fourth),
            ("k", found.data[3].k_hat, k),
        ] {
            assert!((a - b).abs() < 1e-9 * b.abs(), "{what}: {a} and {b}");
        }
        assert_eq!(found.data.iter().filter(|d| d.k_hat > 0.7).count(), unreliable);
    }
}

#[test]
#[allow(clippy::unreadable_literal)]
fn the_difference_is_that_of_arviz() {
    // Source: ArviZ 0.23.4, arviz.compare: elpd_diff and dse.
    let a = LeaveOneOut::of(&densities(400, 12, 0.0, 0.5), 1.0, Vec::new());
    let b = LeaveOneOut::of(&densities(400, 12, 1.5, 0.6), 1.0, Vec::new());
    let found = compare(&a, &b).unwrap();
    assert!((found.elpd - 11.11588277360963).abs() < 1e-8, "{found:?}");
    assert!((found.error - 4.970052470684986).abs() < 1e-8, "{found:?}");
    let back = compare(&b, &a).unwrap();
    assert!(back.elpd == -found.elpd && (back.error - found.error).abs() < 1e-12);
    let message =
        compare(&a, &LeaveOneOut::of(&densities(400, 11, 0.0, 0.5), 1.0, Vec::new())).unwrap_err();
    assert!(message.contains("of 12 and of 11 data"), "{message}");
}

#[test]
#[allow(clippy::unreadable_literal)]
fn the_probabilities_below_are_those_of_arviz() {
    // Source: ArviZ 0.23.4, arviz.loo_pit(y, y_hat, log_weights of psislw(..., reff=1)).
    let truth = [
        0.0459022997860419,
        0.2056523967574425,
        0.5235918139988889,
        0.22106374710421797,
        0.1728581368312304,
        0.6647633586593016,
        0.7693308602825085,
        0.3989465060603961,
        0.6324306263920632,
        0.9335857965999962,
        0.8949349685308411,
        0.5697266086146938,
    ];
    let (draws, data) = (400, 12);
    let simulated = Matrix::from_fn(draws, data, |s, i| {
        let p = (((s * 41 + i * 17) % draws) as f64 + 0.5) / draws as f64;
        (1.7 * i as f64).cos() + 0.8 * (p / (1.0 - p)).ln()
    });
    let measured: Vec<f64> = (0..data).map(|k| 0.3 * k as f64 - 1.5).collect();
    let densities = densities(draws, data, 0.0, 0.5);
    let found = probabilities_below(&measured, &simulated, &densities, 1.0);
    for (ours, theirs) in found.iter().zip(truth) {
        assert!((ours - theirs).abs() < 1e-9, "{ours} and {theirs}");
    }
}

#[test]
fn equal_values_count_half_and_unknown_ones_are_told() {
    let densities = Matrix::zeros(4, 2);
    let simulated = Matrix::from_rows(2, [[1.0, 1.0], [2.0, 2.0], [2.0, f64::NAN], [3.0, 4.0]]);
    let found = probabilities_below(&[2.0, 2.0], &simulated, &densities, 1.0);
    assert!((found[0] - 0.5).abs() < 1e-12 && found[1].is_nan(), "{found:?}");
}

#[test]
fn left_out_normal_data_have_their_exact_predictions() {
    // n normal data of variance one with a flat prior on their mean: the posterior is N(mean, 1 / n), and a datum given
    // the others is N(mean of those, 1 + 1 / (n - 1)).
    let (n, draws) = (20, 8000);
    let mut rng = Stream::root(1).generator();
    let data: Vec<f64> = (0..n).map(|_| normal(&mut rng)).collect();
    let centre = mean(&data);
    let means: Vec<f64> =
        (0..draws).map(|_| centre + normal(&mut rng) / (n as f64).sqrt()).collect();
    let law = |x: f64, mean: f64, variance: f64| {
        -0.5 * (x - mean).powi(2) / variance - 0.5 * variance.ln() - HALF_LN_TWO_PI
    };
    let found = LeaveOneOut::of(
        &Matrix::from_fn(draws, n, |s, i| law(data[i], means[s], 1.0)),
        1.0,
        Vec::new(),
    );
    let others = n as f64 - 1.0;
    for (left, &x) in found.data.iter().zip(&data) {
        let exact = law(x, (centre * n as f64 - x) / others, 1.0 + 1.0 / others);
        // The importance ratio varies by less than 50 % over the posterior: 8000 draws give three digits.
        assert!((left.elpd - exact).abs() < 0.02, "{} and {exact}", left.elpd);
    }
    assert!((found.parameters - 1.0).abs() < 0.5 && found.unreliable == 0, "{found:?}");
}

#[test]
fn data_without_a_value_are_unreliable() {
    let mut densities = densities(400, 3, 0.0, 0.0);
    assert_eq!(LeaveOneOut::of(&densities, 1.0, Vec::new()).unreliable, 0);
    densities[(7, 1)] = f64::NEG_INFINITY;
    assert_eq!(LeaveOneOut::of(&densities, 1.0, Vec::new()).unreliable, 1);
}

#[test]
#[allow(clippy::unreadable_literal)]
fn dependent_draws_have_the_tails_of_arviz() {
    // Source: ArviZ 0.23.4, arviz.loo(..., reff=...): elpd_loo, se, p_loo, loo_i and pareto_k of the fourth datum, and
    // the number of shapes above its good_k, 0.6157 for 400 draws.
    for (efficiency, elpd, error, parameters, unreliable, fourth, k) in [
        (
            0.4,
            -9.56319476970642,
            1.3647714698851785,
            2.7562563438619305,
            5,
            -0.45237122593919477,
            0.4537603341200676,
        ),
        (
            1.8,
            -9.558938034700843,
            1.36250681692025,
            2.7519996088563525,
            6,
            -0.4524032389731918,
            0.47078814397735586,
        ),
    ] {
        let found = LeaveOneOut::of(&densities(400, 12, 0.0, 0.5), efficiency, Vec::new());
        for (what, a, b) in [
            ("elpd", found.elpd, elpd),
            ("error", found.error, error),
            ("parameters", found.parameters, parameters),
            ("fourth", found.data[3].elpd, fourth),
            ("k", found.data[3].k_hat, k),
            ("limit", found.limit, 0.6156891065798796),
        ] {
            assert!((a - b).abs() < 1e-9 * b.abs(), "{efficiency} {what}: {a} and {b}");
        }
        assert_eq!(found.unreliable, unreliable);
    }
}

#[test]
fn few_draws_allow_small_shapes_only() {
    // Source: Vehtari et al., J. Mach. Learn. Res. 25 (2024) 72, section 3.2.4: min(1 - 1 / log10 S, 0.7).
    for (draws, expected) in [(10, 0.0), (100, 0.5), (1000, 2.0 / 3.0), (2200, 0.7), (100_000, 0.7)]
    {
        let found = limit(draws);
        assert!((found - expected).abs() < 1e-12, "{draws}: {found}");
    }
}

/// Pointwise elpd of `curves` curves of `length` values: the sum of a term common to the curve and an independent term.
fn curves(
    curves: usize,
    length: usize,
    shared: f64,
    own: f64,
    seed: u64,
) -> (Vec<f64>, Vec<usize>) {
    let mut rng = Stream::root(seed).generator();
    let mut values = Vec::new();
    for _ in 0..curves {
        let common = shared * normal(&mut rng);
        values.extend((0..length).map(|_| -1.0 + common + own * normal(&mut rng)));
    }
    (values, (0..curves * length).map(|i| i / length).collect())
}

#[test]
fn the_error_by_curve_is_that_of_correlated_values() {
    // The variance of the sum of C curves of n values is C (n^2 a^2 + n b^2), with a the sd of the term common to a
    // curve and b that of the independent term; for values taken as independent it would be C n (a^2 + b^2). Over 400
    // data sets the mean square of the estimates has the relative standard error sqrt(2 / (400 (C - 1))).
    let (count, length, sets) = (12, 25, 400);
    for (shared, own) in [(0.7_f64, 1.0_f64), (0.0, 1.0)] {
        let (mut by_curve, mut pointwise) = (0.0, 0.0);
        for seed in 0..sets {
            let (values, curve) = curves(count, length, shared, own, seed);
            by_curve += error_by_curve(&values, &curve).unwrap().powi(2);
            pointwise += error_of_sum(&values).powi(2);
        }
        let n = length as f64;
        let truth = count as f64 * (n * n * shared * shared + n * own * own);
        let ratio = by_curve / sets as f64 / truth;
        let bound = 4.0 * (2.0 / (sets as f64 * (count as f64 - 1.0))).sqrt();
        assert!((ratio - 1.0).abs() < bound, "{shared}: {ratio}");
        // Computed as if the values were independent, it is far too small if they are not.
        let share = pointwise / sets as f64 / truth;
        assert!(if shared > 0.0 { share < 0.15 } else { (share - 1.0).abs() < 0.1 }, "{share}");
    }
}

#[test]
fn curves_of_any_length_count_and_one_curve_has_no_error() {
    // Curves whose values are all equal do not differ, however long they are.
    let equal = error_by_curve(&[-2.0; 6], &[0, 0, 0, 0, 1, 2]).unwrap();
    assert!(equal.abs() < 1e-12);
    // Deviations from the mean 2 by curve: -1 - 1 and 1 + 1; times C / (C - 1) = 2.
    let two = error_by_curve(&[1.0, 1.0, 3.0, 3.0], &[0, 0, 1, 1]).unwrap();
    assert!((two - 4.0).abs() < 1e-12, "{two}");
    assert_eq!(error_by_curve(&[1.0, 2.0], &[0, 0]), None);
    assert_eq!(error_by_curve(&[1.0, 2.0], &[]), None);
}

#[test]
fn models_are_compared_curve_by_curve() {
    let curve: Vec<usize> = (0..12).map(|i| i / 3).collect();
    let a = LeaveOneOut::of(&densities(400, 12, 0.0, 0.5), 1.0, curve.clone());
    let b = LeaveOneOut::of(&densities(400, 12, 1.5, 0.6), 1.0, curve.clone());
    let found = compare(&a, &b).unwrap();
    let differences: Vec<f64> = a.data.iter().zip(&b.data).map(|(a, b)| a.elpd - b.elpd).collect();
    let mean = found.elpd / 12.0;
    let sums = differences.chunks(3).map(|own| own.iter().map(|d| d - mean).sum::<f64>());
    let expected = (4.0 / 3.0 * sums.map(|s| s * s).sum::<f64>()).sqrt();
    assert!((found.error_by_curve.unwrap() - expected).abs() < 1e-12);
    let other = LeaveOneOut { curve: Vec::new(), ..b };
    assert_eq!(compare(&a, &other).unwrap().error_by_curve, None);
}

#[test]
fn left_out_curves_of_correlated_values_have_their_exact_predictions() {
    // C curves of m values about an unknown level with a flat prior: noise of variance one, and an offset of variance
    // t^2 common to the values of a curve. The level given all curves is normal about their mean with variance
    // (1/m + t^2) / C; a left-out curve given the others is normal about their mean with covariance I + (t^2 + v) 11',
    // where v is the variance of the level given C - 1 curves.
    let (count, m, t, draws) = (15, 8, 0.8_f64, 8000);
    let mut rng = Stream::root(3).generator();
    let data: Vec<Vec<f64>> = (0..count)
        .map(|_| {
            let offset = t * normal(&mut rng);
            (0..m).map(|_| offset + normal(&mut rng)).collect()
        })
        .collect();
    // The log density of values about a level with covariance I + s 11'.
    let law = |y: &[f64], level: f64, s: f64| {
        let n = y.len() as f64;
        let sum: f64 = y.iter().map(|y| y - level).sum();
        let squares: f64 = y.iter().map(|y| (y - level).powi(2)).sum();
        let quadratic = squares - s / (1.0 + n * s) * sum * sum;
        -0.5 * (quadratic + (1.0 + n * s).ln()) - n * HALF_LN_TWO_PI
    };
    let means: Vec<f64> = data.iter().map(|y| mean(y)).collect();
    let spread = (1.0 / f64::from(m) + t * t) / count as f64;
    let levels: Vec<f64> =
        (0..draws).map(|_| mean(&means) + spread.sqrt() * normal(&mut rng)).collect();
    let found = LeaveOneOut::of(
        &Matrix::from_fn(draws, count, |s, c| law(&data[c], levels[s], t * t)),
        1.0,
        Vec::new(),
    );
    let others = count as f64 - 1.0;
    let mut total = 0.0;
    for (c, left) in found.data.iter().enumerate() {
        let centre = (mean(&means) * count as f64 - means[c]) / others;
        let exact = law(&data[c], centre, t * t + (1.0 / f64::from(m) + t * t) / others);
        total += exact;
        // The ratios of fifteen curves vary little over the posterior: 8000 draws give at least two digits.
        assert!((left.elpd - exact).abs() < 0.03, "{c}: {} and {exact}", left.elpd);
    }
    assert!((found.elpd - total).abs() < 0.1 && found.unreliable == 0, "{} {total}", found.elpd);
}

/// A sample of all data gives the sums over all data.
#[test]
fn a_sample_of_everything_is_exact() {
    let curve: Vec<usize> = (0..12).map(|i| i / 3).collect();
    let all = LeaveOneOut::of(&densities(400, 12, 0.0, 0.5), 1.0, curve);
    let mut about = Approximation::default();
    all.data.iter().enumerate().for_each(|(i, left)| about.add(left.elpd, i % 3 == 0, true));
    let found = LeaveOneOut::from_sample(all.data.clone(), &about, all.limit);
    for (a, b) in [
        (found.elpd, all.elpd),
        (found.error, all.error),
        (found.parameters, all.parameters),
        (found.error_by_curve.unwrap(), all.error_by_curve.unwrap()),
    ] {
        assert!((a - b).abs() < 1e-9 * b.abs(), "{a} and {b}");
    }
    assert_eq!(found.sampled, Some(Sampled { of: 12, error: 0.0 }));
}

/// Samples of exact predictions: their estimates scatter about the sum as their standard errors say, whatever the
/// approximation, and the better it is the less.
#[test]
fn samples_of_many_data_scatter_as_their_errors_say() {
    let (all, size, repeats) = (3000, 200, 600);
    let mut rng = Stream::root(6).generator();
    let exact: Vec<f64> = (0..all).map(|_| -0.5 * normal(&mut rng).powi(2)).collect();
    let truth: f64 = exact.iter().sum();
    let mut errors = Vec::new();
    for noise in [0.01, 1.0] {
        let about: Vec<f64> = exact.iter().map(|e| e - 0.1 + noise * normal(&mut rng)).collect();
        let (mut squares, mut stated) = (0.0, 0.0);
        for _ in 0..repeats {
            let mut chosen = permutation(&mut rng, all);
            chosen.truncate(size);
            chosen.sort_unstable();
            let mut approximation = Approximation::default();
            for (i, value) in about.iter().enumerate() {
                approximation.add(*value, false, chosen.binary_search(&i).is_ok());
            }
            let left = |&i: &usize| Left { elpd: exact[i], with_it: exact[i], k_hat: 0.0 };
            let sample = chosen.iter().map(left).collect();
            let found = LeaveOneOut::from_sample(sample, &approximation, 0.7);
            squares += (found.elpd - truth).powi(2) / f64::from(repeats);
            stated += found.sampled.unwrap().error.powi(2) / f64::from(repeats);
        }
        // The mean square of `repeats` normal numbers has the relative standard deviation sqrt(2 / repeats).
        let bound = 4.0 * (2.0 / f64::from(repeats)).sqrt();
        assert!((squares / stated - 1.0).abs() < bound, "{squares} and {stated}");
        errors.push(stated.sqrt());
    }
    assert!(errors[0] < 0.02 * errors[1]);
}

#[test]
fn samples_of_the_same_data_are_compared() {
    let of = |shift: f64, count: usize| {
        let left = |i: usize| Left { elpd: (i as f64).sin() + shift, with_it: 0.0, k_hat: 0.0 };
        let mut about = Approximation::default();
        (0..count).for_each(|i| about.add((i as f64).sin() + shift, false, i < 50));
        LeaveOneOut::from_sample((0..50).map(left).collect(), &about, 0.7)
    };
    let found = compare(&of(0.0, 1000), &of(-0.1, 1000)).unwrap();
    assert!((found.elpd - 100.0).abs() < 1e-9 && found.error < 1e-9, "{found:?}");
    assert!(compare(&of(0.0, 1000), &of(0.0, 900)).is_err());
}
