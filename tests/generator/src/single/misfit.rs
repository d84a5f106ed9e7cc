//! The part of missing physics that the parameters of a model cannot absorb, to first order.

use super::FINE;
use super::system::System;

/// Relative step of differences.
const STEP: f64 = 1e-4;

/// Root mean square of the difference between two responses after the best shift of the free parameters.
pub fn beside_parameters(
    system: System,
    truth: &[f64],
    times: &[f64],
    with: &[f64],
    without: &[f64],
) -> f64 {
    let mut rest: Vec<f64> = with.iter().zip(without).map(|(a, b)| a - b).collect();
    let mut directions: Vec<Vec<f64>> = Vec::new();
    for (j, parameter) in system.parameters().iter().enumerate() {
        if parameter.is_known() {
            continue;
        }
        let step = STEP * parameter.width();
        let moved = |sign: f64| {
            let mut point = truth.to_vec();
            point[j] += sign * step;
            system.solution(&point, &[], times, FINE)
        };
        let (above, below) = (moved(1.0), moved(-1.0));
        let mut slope: Vec<f64> =
            above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * STEP)).collect();
        // Twice, against round-off (Giraud and others, Numerische Mathematik 101 (2005) 87).
        for _ in 0..2 {
            for direction in &directions {
                remove(&mut slope, direction);
            }
        }
        let size = product(&slope, &slope).sqrt();
        if size > 1e-9 * product(with, with).sqrt() {
            directions.push(slope.iter().map(|x| x / size).collect());
        }
    }
    for direction in &directions {
        remove(&mut rest, direction);
    }
    (product(&rest, &rest) / rest.len() as f64).sqrt()
}

fn remove(curve: &mut [f64], direction: &[f64]) {
    let along = product(curve, direction);
    curve.iter_mut().zip(direction).for_each(|(x, d)| *x -= along * d);
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
