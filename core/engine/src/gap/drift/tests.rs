//! Drift in linear worlds whose noise is known.
#![allow(clippy::unwrap_used)]

use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin};
use lacuna_linalg::Matrix;

use super::{DriftLevel, DriftMap, DriftOptions, drift};
use crate::gap::experiment::Experiment;
use crate::gap::noise::Noise;
use crate::gap::system::System;
use crate::gap::system::fit::fit;
use crate::gap::system::whitener::Whitener;
use crate::gap::testing::SyntheticExperiment;

const TIMES: usize = 40;
const SENSORS: [&str; 3] = ["a", "b", "c"];

/// `y = level + rate t / 40 (sensor + 1)` under two conditions.
fn world() -> SyntheticExperiment {
    SyntheticExperiment::new(
        &["slow", "fast"],
        &SENSORS,
        TIMES,
        0.6,
        &["level", "rate"],
        |j, c, s, t| {
            if j == 0 { 1.0 } else { (c + 1) as f64 * t / TIMES as f64 * (s + 1) as f64 }
        },
    )
}

fn mapped(experiment: &Experiment<'_>, noise: &Noise, options: DriftOptions) -> DriftMap {
    let (_, means) = experiment.means();
    let whitener = Whitener::new(experiment, noise, &means);
    let system = System::new(experiment, Vec::new());
    let found = fit(&system, &whitener, &means, &[0.0, 0.0]);
    drift(&system, &found, noise, &whitener, options, &Stream::root(1)).unwrap()
}

const LINEAR: DriftOptions = DriftOptions { windows: 3, refits: 0, simulations: 0 };

/// Without drift the statistics are chi squared with their degrees of freedom, with emulator error and correlated
/// windows: over n data sets the mean is the number of degrees of freedom with standard error `sqrt(2 freedom / n)`,
/// and the rate of p below 0.1 is 0.1 with standard error `sqrt(0.09 / n)`.
#[test]
fn without_drift_the_statistics_have_their_law() {
    let world = world();
    let (n, point) = (300, [0.7, -0.4]);
    let truth = world.response(&point);
    let smooth = Matrix::from_fn(truth.len(), 1, |i, _| 0.8 * (i as f64 / 15.0).sin());
    let (mut statistics, mut small) = (vec![Vec::new(); 6], [0.0; 6]);
    for b in 0..n {
        let stream = Stream::root(40).at(b);
        let shift = normal(&mut stream.named("shift").generator());
        let moved: Vec<f64> =
            truth.iter().zip(smooth.as_slice()).map(|(y, u)| y + shift * u).collect();
        let mut experiment = world.experiment(&moved, 4, &stream);
        experiment.common = vec![CommonError {
            origin: ErrorOrigin::Numerics,
            factor: smooth.clone().into(),
            predictive: true,
        }];
        let map = mapped(&experiment, &world.noise, LINEAR);
        let own = [map.all, map.conditions.unwrap()].into_iter();
        let each = map.parameters.iter().flat_map(|p| [p.equality, p.alone]);
        for (k, test) in own.chain(each).enumerate() {
            statistics[k].push((test.statistic, test.freedom as f64));
            small[k] += f64::from(u8::from(test.p < 0.1)) / n as f64;
        }
    }
    for (k, own) in statistics.iter().enumerate() {
        let freedom = own[0].1;
        let mean = own.iter().map(|(s, _)| s).sum::<f64>() / n as f64;
        let error = (2.0 * freedom / n as f64).sqrt();
        assert!(freedom >= 1.0 && (mean - freedom).abs() < 4.0 * error, "{k}: {mean} {freedom}");
        assert!((small[k] - 0.1).abs() < 4.0 * (0.09 / n as f64).sqrt(), "{k}: {}", small[k]);
    }
    // Six windows of two parameters with their common values fitted: ten differences; between two conditions two.
    assert_eq!(statistics[0][0].1, 10.0);
    assert_eq!(statistics[1][0].1, 2.0);
}

/// One parameter, two conditions, white noise: the recalibrated values are means with the prior about the joint fit,
/// and the statistic is the squared difference of the means over its variance (the two-sample z test).
#[test]
fn two_conditions_are_compared_as_two_means() {
    let world =
        SyntheticExperiment::new(&["x", "y"], &["a"], TIMES, 0.0, &["level"], |_, _, _, _| 1.0);
    let mut truth = world.response(&[0.0]);
    truth[TIMES..].iter_mut().for_each(|y| *y += 0.4);
    let experiment = world.experiment(&truth, 5, &Stream::root(9));
    let map = mapped(&experiment, &world.noise, DriftOptions { windows: 1, ..LINEAR });
    let (_, means) = experiment.means();
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let (first, second) = (mean(&means[..TIMES]), mean(&means[TIMES..]));
    let information = 5.0 * TIMES as f64;
    let z = (second - first) / (2.0 / information).sqrt();
    assert!((map.all.statistic - z * z).abs() < 1e-5 * z * z, "{map:?}");
    assert_eq!(map.all.freedom, 1);
    let centre = 0.5 * (first + second);
    let joint = centre * 2.0 * information / (2.0 * information + 1.0);
    for (piece, own) in map.pieces.iter().zip([first, second]) {
        let held = joint + (own - centre) * information / (information + 1.0);
        assert!((piece.values[0] - held).abs() < 1e-5, "{} {held}", piece.values[0]);
        assert!((piece.sd[0] - 1.0 / (information + 1.0).sqrt()).abs() < 1e-9);
    }
    assert!(matches!(map.reading, DriftLevel::Either { .. }), "{}", map.words);
    // Exact refits of a linear model change nothing.
    let refitted =
        mapped(&experiment, &world.noise, DriftOptions { windows: 1, refits: 4, simulations: 0 });
    for (a, b) in map.pieces.iter().zip(&refitted.pieces) {
        assert!((a.values[0] - b.values[0]).abs() < 1e-9, "{a:?} {b:?}");
    }
}

/// A rate that falls with time is attributed to the model, an offset by which one sensor jumps to its measuring chain.
#[test]
fn drift_of_the_model_is_told_from_drift_of_a_sensor() {
    let world = world();
    let plain = world.response(&[0.5, 0.5]);
    let options = DriftOptions { windows: 3, refits: 3, simulations: 99 };
    let time = |i: usize| (i % TIMES) as f64 / TIMES as f64;
    let model: Vec<f64> =
        (0..plain.len()).map(|i| 0.5 + (plain[i] - 0.5) * (1.0 - 2.5 * (time(i) - 0.5))).collect();
    let map = mapped(&world.experiment(&model, 6, &Stream::root(5)), &world.noise, options);
    assert!(matches!(map.reading, DriftLevel::Model { .. }), "{} {map:?}", map.words);
    assert!(map.all.p <= 0.01 && map.parameters[1].alone.p <= 0.01, "{map:?}");
    let sensor: Vec<f64> = (0..plain.len())
        .map(|i| plain[i] + if i / TIMES % 3 == 2 && time(i) > 0.5 { 2.0 } else { 0.0 })
        .collect();
    let map = mapped(&world.experiment(&sensor, 6, &Stream::root(6)), &world.noise, options);
    let DriftLevel::Response { on } = &map.reading else { panic!("{} {map:?}", map.words) };
    assert_eq!(on["sensor"], ["c"], "{}", map.words);
    let map = mapped(&world.experiment(&plain, 6, &Stream::root(7)), &world.noise, options);
    assert_eq!(map.reading, DriftLevel::None, "{}", map.words);
}
