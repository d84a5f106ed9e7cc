//! The fixture's comparison with the data, draws with their responses, and curves of the chains.

use lacuna::data::Layout;

use super::fixture::{MEAN, SD, SENSORS, measured, parameters, response};
use crate::report::findings::{DrawnResponses, Energies, MainEffect, Mixing};
use crate::stage::validate::{ValidationCase, ValidationFindings};

/// Draws along a line through the posterior mean, with responses that shift with them.
pub fn drawn(layout: &Layout) -> DrawnResponses {
    let shift = |k: usize| 0.02 * (k as f64 - 19.5) / 19.5;
    let point = |k: usize| MEAN.iter().zip(SD).map(|(m, s)| m + 100.0 * shift(k) * s).collect();
    DrawnResponses {
        points: (0..40).map(point).collect(),
        responses: (0..40).map(|k| response(layout, shift(k), 1.0)).collect(),
    }
}

/// Chains of which one lies apart.
pub fn mixing() -> Vec<Mixing> {
    let ranks = |c: usize| -> Vec<f64> {
        let size = if c == 17 { 0.4 } else { 0.03 };
        (0..=40).map(|k| size * (std::f64::consts::PI * f64::from(k) / 40.0).sin()).collect()
    };
    let one = |_: usize| Mixing {
        chains: (0..20).collect(),
        ranks: (0..20).map(ranks).collect(),
        autocorrelation: (0..=100).map(|lag| (lag, 0.95_f64.powi(lag as i32))).collect(),
    };
    (0..4).map(one).collect()
}

/// Energies of two chains, one of which hardly changes its own.
pub fn energies() -> Energies {
    let wave = |k: i32| (f64::from(k) * 0.7).sin() + 0.4 * (f64::from(k) * 0.11).cos();
    let levels: Vec<f64> = (0..400).map(wave).collect();
    let changes = levels.windows(2).map(|pair| pair[1] - pair[0]).collect();
    Energies { levels, changes, fractions: vec![0.9, 0.12] }
}

/// A bend, a rise and a flat line.
pub fn main_effects() -> Vec<MainEffect> {
    let one = |(i, parameter): (usize, lacuna::data::Parameter)| {
        let share = |k: usize| k as f64 / 14.0;
        let mean: Vec<f64> =
            (0..15).map(|k| 1e-4 * [4.0 * (share(k) - 0.5).powi(2), share(k), 0.4][i]).collect();
        MainEffect {
            output: 20 * (i + 1),
            values: (0..15).map(|k| parameter.design.quantile(0.02 + 0.96 * share(k))).collect(),
            interval: mean.iter().map(|y| (y - 5e-5, y + 8e-5)).collect(),
            mean,
            parameter,
        }
    };
    parameters().into_iter().enumerate().map(one).collect()
}

pub fn validation(layout: &Layout) -> ValidationFindings {
    let replicates = measured(layout).used.summaries();
    let case = |name: &str, point: &[f64], shift, gain, base: f64, rmse| {
        let accuracy = SENSORS.iter().enumerate().map(|(i, s)| {
            ((*s).to_owned(), (base + 0.18 * (i as f64 * 1.3).sin()).clamp(0.0, 1.0))
        });
        ValidationCase {
            name: name.into(),
            point: point.to_vec(),
            response: response(layout, shift, gain),
            simulated: true,
            accuracy: accuracy.collect(),
            average: base,
            rmse,
        }
    };
    let center = response(layout, 0.004, 1.0);
    ValidationFindings {
        cases: vec![
            case("map", &MEAN[..3], 0.02, 0.97, 0.78, 1.9e-5),
            case("reference", &[1.5e5, 13_500.0, 1456.0], 0.13, 1.16, 0.52, 4.6e-5),
        ],
        replicates: replicates.iter().map(|s| (s.count, s.mean, s.sd().unwrap_or(0.0))).collect(),
        residuals: center.iter().zip(&replicates).map(|(y, s)| (s.mean - y) / 3.2e-5).collect(),
        predictive: Some((
            center.iter().map(|c| c - 6.3e-5).collect(),
            center.iter().map(|c| c + 6.3e-5).collect(),
        )),
        spread: [("discrepancy", 2.9e-5), ("emulator", 1.1e-5), ("measurement", 1.4e-5)]
            .map(|(origin, sd)| (origin.to_owned(), sd))
            .to_vec(),
    }
}
