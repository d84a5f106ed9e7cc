//! Cross-validation, discrimination and whitening in linear models whose densities are known.
#![allow(clippy::unwrap_used)]

use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin};
use lacuna_linalg::{Cholesky, Matrix, multiply_transposed};

use super::{Explanation, FurtherData, LeftOut, cross_validate, discriminate};
use crate::gap::experiment::Experiment;
use crate::gap::system::System;
use crate::gap::system::fit::fit;
use crate::gap::system::whitener::Whitener;
use crate::gap::testing::SyntheticExperiment;

const TIMES: usize = 24;
const REPLICATES: usize = 4;
const MEMORY: f64 = 0.3;

/// `level + rate t / 24` or `level + bend (t / 24)^2`, twice as large under the second condition.
fn world(second: &str, power: i32) -> SyntheticExperiment {
    SyntheticExperiment::new(
        &["x", "y"],
        &["a", "b"],
        TIMES,
        MEMORY,
        &["level", second],
        |j, c, _, t| (c + 1) as f64 * if j == 0 { 1.0 } else { (t / TIMES as f64).powi(power) },
    )
}

/// The covariance of means over these numbers of replicates with the prior of a world's parameters at some outputs,
/// where `forgets` tells pairs without common noise.
fn covariance(
    world: &SyntheticExperiment,
    own: &[usize],
    counts: &[f64],
    forgets: impl Fn(usize, usize) -> bool,
) -> Matrix {
    let slopes = &world.forward.slopes;
    Matrix::from_fn(own.len(), own.len(), |k, l| {
        let (i, j) = (own[k], own[l]);
        let prior: f64 = (0..2).map(|p| slopes[(p, i)] * slopes[(p, j)]).sum();
        let tied = i / TIMES == j / TIMES && !forgets(i, j);
        let lag = i.abs_diff(j) as i32;
        let noise = if tied { MEMORY.powi(lag) / (1.0 - MEMORY * MEMORY) } else { 0.0 };
        prior + noise / (counts[i] * counts[j]).sqrt()
    })
}

fn log_density(world: &SyntheticExperiment, own: &[usize], counts: &[f64], means: &[f64]) -> f64 {
    let holes = |i: usize, j: usize| {
        let (low, high) = (i.min(j), i.max(j));
        let inside: Vec<&usize> = own.iter().filter(|k| (low..=high).contains(k)).collect();
        inside.windows(2).any(|w| w[1] - w[0] > 2)
    };
    let factor = Cholesky::new(&covariance(world, own, counts, holes)).unwrap();
    let y: Vec<f64> = own.iter().map(|&i| means[i]).collect();
    -0.5 * (factor.quadratic(&y) + factor.log_determinant())
}

/// Applies a comparison to two explanations of which the first is true.
fn both<T>(
    worlds: [&SyntheticExperiment; 2],
    experiment: &Experiment<'_>,
    tell: impl Fn(Explanation<'_, '_>, Explanation<'_, '_>) -> T,
) -> T {
    let other = Experiment {
        parameters: &worlds[1].parameters,
        forward: &worlds[1].forward,
        ..experiment.clone()
    };
    let systems = [System::new(experiment, Vec::new()), System::new(&other, Vec::new())];
    let (_, means) = experiment.means();
    let whitener = Whitener::new(experiment, &worlds[0].noise, &means);
    let fits = [0, 1].map(|k| fit(&systems[k], &whitener, &means, &[0.0, 0.0]));
    let rival = |k: usize| Explanation::exact(&systems[k], &fits[k]);
    tell(rival(0), rival(1))
}

/// The log density of a part given the rest is that of both less that of the rest, normal with the prior's and the
/// noise's covariance: all dense.
#[test]
fn what_is_left_out_has_its_conditional_density() {
    let worlds = [&world("rate", 1), &world("bend", 2)];
    let truth = worlds[0].response(&[0.3, 0.8]);
    let experiment = worlds[0].experiment(&truth, REPLICATES, &Stream::root(3));
    let found = both(worlds, &experiment, |a, b| cross_validate(a, b, &worlds[0].noise, 1));
    let (counts, means) = experiment.means();
    let all: Vec<usize> = (0..means.len()).collect();
    let without = |own: &[usize], out: &dyn Fn(usize) -> bool| -> Vec<usize> {
        own.iter().copied().filter(|&i| !out(i)).collect()
    };
    let score = |own: &[usize], counts: &[f64], means: &[f64]| {
        log_density(worlds[0], own, counts, means) - log_density(worlds[1], own, counts, means)
    };
    let told = |own: &[usize], out: &dyn Fn(usize) -> bool| {
        score(own, &counts, &means) - score(&without(own, out), &counts, &means)
    };
    let half = 2 * TIMES;
    let exact = |left_out: LeftOut| -> f64 {
        match left_out {
            LeftOut::Condition => (0..2).map(|c| told(&all, &|i| i / half == c)).sum(),
            LeftOut::Sensor => (0..2).map(|s| told(&all, &|i| i / TIMES % 2 == s)).sum(),
            LeftOut::Replicate => (0..2 * REPLICATES)
                .map(|k| {
                    let (c, r) = (k / REPLICATES, k % REPLICATES);
                    let mut replicates: Vec<_> =
                        experiment.conditions.iter().map(|c| c.replicates.clone()).collect();
                    replicates[c].remove(r);
                    let (fewer, rest) = experiment.with_replicates(replicates).means();
                    score(&all, &counts, &means) - score(&all, &fewer, &rest)
                })
                .sum(),
            // The sum of the autocorrelations is 13 / 7: four values lie between a block of six and the rest.
            LeftOut::Block => (0..8)
                .map(|k| {
                    let (c, begin, end) = (k / 4, k % 4 * 6, k % 4 * 6 + 6);
                    let inside = |i: usize| i / half == c && (begin..end).contains(&(i % TIMES));
                    let near = |i: usize| {
                        let around = begin.saturating_sub(4)..end + 4;
                        i / half == c && around.contains(&(i % TIMES)) && !inside(i)
                    };
                    told(&without(&all, &near), &inside)
                })
                .sum(),
        }
    };
    assert_eq!(found.len(), 4);
    for own in &found {
        let exact = exact(own.left_out);
        assert!((own.difference - exact).abs() < 1e-4 * exact.abs().max(1.0), "{own:?} {exact}");
        assert!(own.by_replicates && own.error.unwrap() > 0.0, "{own:?}");
    }
}

/// The standard error by leaving replicates out is the standard deviation over data sets. That of a standard deviation
/// of n values is `1 / sqrt(2 n)` of it; that the rest varies too is of second order, and has a tenth.
#[test]
fn the_error_is_the_spread_over_data_sets() {
    let worlds = [&world("rate", 1), &world("bend", 2)];
    let truth = worlds[0].response(&[0.3, 2.5]);
    let n = 120;
    let (mut differences, mut errors) = (Vec::new(), Vec::new());
    for b in 0..n {
        let experiment = worlds[0].experiment(&truth, 6, &Stream::root(60).at(b));
        let found = both(worlds, &experiment, |a, b| cross_validate(a, b, &worlds[0].noise, 1));
        differences.push(found[0].difference);
        errors.push(found[0].error.unwrap().powi(2));
    }
    let spread = lacuna::math::moments::variance(&differences).sqrt();
    let error = lacuna::math::moments::mean(&errors).sqrt();
    let bound = 0.1 + 4.0 / (2.0 * n as f64).sqrt();
    assert!((error / spread - 1.0).abs() < bound, "{error} {spread}");
}

/// The lead is half of `D' (S + J J')^-1 D` with the difference D of the two responses, the noise S of the means and
/// the slopes J of the one that is not true: all dense.
#[test]
fn what_would_separate_has_its_closed_form() {
    let worlds = [&world("rate", 1), &world("bend", 2)];
    let truth = worlds[0].response(&[0.3, 1.0]);
    let experiment = worlds[0].experiment(&truth, REPLICATES, &Stream::root(8));
    let (found, difference) = both(worlds, &experiment, |a, b| {
        let pairs = a.fit.at.response.iter().zip(&b.fit.at.response);
        let difference: Vec<f64> = pairs.map(|(a, b)| a - b).collect();
        (discriminate(&[a, b], &worlds[0].noise).unwrap(), difference)
    });
    let all: Vec<usize> = (0..difference.len()).collect();
    let lead = |counts: &[f64]| {
        let of = |world: &SyntheticExperiment| {
            let factor = Cholesky::new(&covariance(world, &all, counts, |_, _| false)).unwrap();
            0.5 * factor.quadratic(&difference)
        };
        of(worlds[0]).min(of(worlds[1]))
    };
    let (counts, _) = experiment.means();
    assert!((found.now - lead(&counts)).abs() < 1e-4 * found.now, "{}", found.now);
    let condition = |name: &str| {
        let is = |what: &FurtherData| matches!(what, FurtherData::Condition { scenario } if scenario.as_deref() == Some(name));
        found.ranked.iter().find(|own| is(&own.what)).unwrap()
    };
    let with = |n: usize| -> Vec<f64> {
        let second = |i: usize| if i >= 2 * TIMES { n as f64 } else { 0.0 };
        counts.iter().enumerate().map(|(i, count)| count + second(i)).collect()
    };
    let own = condition("y");
    assert!((own.expected - lead(&with(REPLICATES))).abs() < 1e-4 * own.expected, "{own:?}");
    let needed = own.replicates.unwrap();
    assert!(lead(&with(needed)) >= 3.0 && lead(&with(needed - 1)) < 3.0, "{own:?}");
    // The second condition shows twice the difference.
    assert!(condition("x").replicates.is_none_or(|n| n > needed), "{:?}", condition("x"));
    let order = found.ranked.iter().map(|own| own.replicates.unwrap_or(usize::MAX));
    assert!(order.clone().zip(order.skip(1)).all(|(a, b)| a <= b));
    assert!(found.ranked.iter().any(|own| matches!(own.what, FurtherData::Input { .. })));
}

/// The two roots of a covariance with a part of low rank differ by a rotation: all products and the determinant are equal.
#[test]
fn a_rotated_whitener_has_the_same_lengths() {
    let world = world("rate", 1);
    let truth = world.response(&[0.3, 0.8]);
    let mut experiment = world.experiment(&truth, REPLICATES, &Stream::root(3));
    let outputs = truth.len();
    let mut rng = Stream::root(4).generator();
    let factor = Matrix::from_fn(outputs, 5, |_, _| normal(&mut rng));
    let origin = ErrorOrigin::Emulator;
    experiment.common.push(CommonError { origin, factor: factor.into(), predictive: true });
    let whiteners = [
        Whitener::new(&experiment, &world.noise, &truth),
        Whitener::rotated(&experiment, &world.noise, &truth),
    ];
    let rows = Matrix::from_fn(3, outputs, |_, _| normal(&mut rng));
    let products = whiteners.each_ref().map(|whitener| {
        let white = whitener.whiten_rows(&rows);
        multiply_transposed(&white, &white)
    });
    for (a, b) in products[0].as_slice().iter().zip(products[1].as_slice()) {
        assert!((a - b).abs() < 1e-9 * products[0][(0, 0)], "{a} {b}");
    }
    let [a, b] = whiteners.map(|whitener| whitener.log_determinant());
    assert!((a - b).abs() < 1e-9 * a.abs().max(1.0), "{a} {b}");
}
