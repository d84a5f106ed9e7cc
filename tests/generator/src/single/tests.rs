//! Records compared with closed forms.

use std::f64::consts::TAU;

use super::law::Law;
use super::system::{AROUND, DRIVE, EXCESS, Kind, System};
use super::{FINE, Instrument, kinds, misfit, record};
use crate::noise::Source;

fn near(found: &[f64], times: &[f64], exact: impl Fn(f64) -> f64, tolerance: f64) {
    for (y, &t) in found.iter().zip(times) {
        assert!((y - exact(t)).abs() < tolerance, "at {t}: {y}, exact {}", exact(t));
    }
}

/// `v' = -g - k v`, with `k` the coefficient over the size of the speed.
#[test]
fn a_body_falls_with_linear_drag() {
    let system = System { kind: Kind::Fall };
    let (p, times) = ([9.81, 47.0, 0.5], system.times(60));
    let k = 2.0 / system.sizes(&p, &times)[0];
    let found = system.solution(&p, &[(Law::Loss(1.0), 2.0)], &times, FINE);
    let limit = 9.81 / k;
    let exact = |t: f64| 47.0 + (0.5 + limit) * (1.0 - (-k * t).exp()) / k - limit * t;
    near(&found, &times, exact, 1e-9);
}

/// The linear equation of a driven mass with a constant force.
#[test]
fn a_drive_has_an_offset() {
    let system = System { kind: Kind::Drive };
    let (p, offset, times) = ([1.5, 0.9], 0.05, system.times(100));
    let (d, w) = (p[1], TAU * DRIVE);
    let found = system.solution(&p, &[(Law::Constant, offset)], &times, FINE);
    let exact = |t: f64| {
        let gone = (1.0 - (-d * t).exp()) / d;
        let swung = d / w * (1.0 - (w * t).cos()) - (w * t).sin() + w * gone;
        p[0] / (d * d + w * w) * swung + offset / d * (t - gone)
    };
    near(&found, &times, exact, 1e-9);
}

/// Bernoulli's equation `u' = -k u - c u^n`: `u^(1 - n)` obeys a linear one.
#[test]
fn a_body_cools_by_convection_of_a_power() {
    let system = System { kind: Kind::Cooling };
    let (p, c, n, times) = ([0.01, 360.0], 0.08, 1.25, system.times(80));
    let found = system.solution(&p, &[(Law::Loss(n), c)], &times, FINE);
    let begin = (p[1] - AROUND) / EXCESS;
    // In units of the excess, the coefficient is that of the rate over it.
    let ratio = c / EXCESS / p[0];
    let exact = |t: f64| {
        let grown = (begin.powf(1.0 - n) + ratio) * (p[0] * (n - 1.0) * t).exp() - ratio;
        AROUND + EXCESS * grown.powf(1.0 / (1.0 - n))
    };
    near(&found, &times, exact, 1e-7);
}

/// Dry friction takes the same amplitude, two of its deflection, from each half swing (Lanchester; Den Hartog,
/// Mechanical Vibrations, section 8.6); the sign of the speed is smooth over 0.2 % of its size.
#[test]
fn dry_friction_takes_equal_amplitudes() {
    let system = System { kind: Kind::Free };
    let (p, times) = ([9.0, 0.0, 1.0], system.times(1500));
    let c = 0.2;
    let found = system.solution(&p, &[(Law::Loss(0.0), c)], &times, FINE);
    let half = std::f64::consts::PI / 3.0;
    for n in 1..4 {
        let at = f64::from(n) * half;
        let i = times.iter().position(|t| *t > at).unwrap_or(0);
        let amplitude = 1.0 - 2.0 * f64::from(n) * c / 9.0;
        let share = (found[i].abs() - amplitude).abs() / (2.0 * c / 9.0);
        assert!(share < 0.02, "{n}: {} {amplitude}", found[i]);
    }
}

/// A change of the parameters leaves nothing that they cannot absorb, up to second order.
#[test]
fn parameters_absorb_their_own_change() {
    let system = System { kind: Kind::Free };
    let (p, times) = ([9.0, 0.3, 1.0], system.times(200));
    let plain = system.solution(&p, &[], &times, FINE);
    let moved = system.solution(&[9.01, 0.301, 1.001], &[], &times, FINE);
    let whole = plain.iter().zip(&moved).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 200.0;
    let rest = misfit::beside_parameters(system, &p, &times, &moved, &plain);
    assert!(rest < 0.02 * whole.sqrt(), "{rest} {whole}");
}

/// The standard deviation of `n` independent values has the relative error `1 / sqrt(2 n)`, the correlation of
/// neighbours `sqrt((1 - a^2) / n)`; four of them are allowed.
#[test]
fn instruments_have_the_noise_that_they_state() {
    let n = 20_000;
    let flat = vec![0.0; n];
    for (instrument, a) in [(Instrument::White, 0.0_f64), (Instrument::Coloured, 0.7)] {
        let all = instrument.measured(&flat, 0.1, 1.0, 0.5, &mut Source::new(3));
        let square =
            |lag: usize| all.iter().zip(&all[lag..]).map(|(x, y)| x * y).sum::<f64>() / n as f64;
        let stated = instrument.stated(0.1, 0.5);
        let inflation = (1.0 + a * a) / (1.0 - a * a);
        let error = 4.0 * (inflation / (2.0 * n as f64)).sqrt();
        assert!((square(0).sqrt() / stated.sd - 1.0).abs() < error, "{}", square(0));
        let found = square(1) / square(0);
        assert!((found - a).abs() < 4.0 * ((1.0 - a * a) / n as f64).sqrt(), "{found}");
        let of_memory = if stated.memory > 0.0 { (-0.5 / stated.memory).exp() } else { 0.0 };
        assert!((of_memory - a).abs() < 1e-12, "{of_memory}");
    }
}

/// Every missing physics leaves a misfit of the drawn size, and records have their lengths.
#[test]
fn records_are_complete() {
    for index in 0..kinds() {
        let record = record(2, index);
        assert!((60..=600).contains(&record.values.len()));
        assert!(record.values.iter().all(|y| y.is_finite()), "{index}");
        assert!(record.sd > 0.0 && record.sd < 0.5 * record.spread, "{index}: {}", record.sd);
        assert_eq!(record.ratio > 0.0, !record.missing.laws.is_empty());
    }
}
