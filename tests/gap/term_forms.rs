//! Terms compared with exact solutions: the extended forward map of a study with the term, at values of its unknowns.

use std::f64::consts::TAU;
use std::fs;

use lacuna::run::Silent;
use lacuna_engine::gap::inside::{Pieces, candidates};
use lacuna_engine::stage::direct::Direct;
use lacuna_linalg::Matrix;
use lacuna_run::RunDirectory;

use super::inside::loaded;
use super::term_laws::size;

const HEAD: &str = r#"
[study]
title = "a term"

[[parameter]]
name = "supply"
unit = "SUPPLY"
prior = { normal = [1.0, 1.0] }

[response]
name = "y"
unit = "OBSERVED"
axes = { t = { first = 0.1, last = 4.0, count = 40, unit = "s" } }

[measurements]
use = "csv"
path = "data.csv"

[discrepancy]
use = "gaussian"
variance = { half_normal = 1.0 }

[sampler]
use = "affine_invariant_ensemble"

[gap]
candidates = []

"#;

pub(super) fn times() -> Vec<f64> {
    (1..=40).map(|i| 0.1 * f64::from(i)).collect()
}

/// Response with the term at a point: the supply, the coefficient, the term's further unknowns.
pub(super) fn response(units: [&str; 2], body: &str, point: &[f64]) -> Vec<f64> {
    let text = HEAD.replace("SUPPLY", units[0]).replace("OBSERVED", units[1]) + body;
    let folder = tempfile::tempdir().unwrap();
    let rows = times().into_iter().map(|t| format!("1,{t},1.0\n"));
    let csv = format!("replicate,t [s],y [{}]\n", units[1]) + &rows.collect::<String>();
    fs::write(folder.path().join("data.csv"), csv).unwrap();
    let study = loaded(&folder, &text);
    let pieces = Pieces::of(&study).unwrap().unwrap();
    assert_eq!(pieces.all.len(), 1);
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    let prepared = Direct::of(&study, &mut run, &Silent).unwrap();
    let known = prepared.problem();
    let (_, wide) = candidates(&pieces, &study, &known, &mut run, &Silent).unwrap();
    let response = wide.forward.mean(&Matrix::from_rows(point.len(), [point])).into_vec();
    let jacobian = wide.forward.jacobian(point);
    // The derivatives agree with differences of the response.
    for j in 1..point.len() {
        let step = 1e-4 * point[j].abs();
        let moved = |sign: f64| {
            let mut moved = point.to_vec();
            moved[j] += sign * step;
            wide.forward.mean(&Matrix::from_rows(moved.len(), [moved])).into_vec()
        };
        let (above, below) = (moved(1.0), moved(-1.0));
        let largest = (0..40).fold(0.0, |most: f64, i| most.max(jacobian[(i, j)].abs()));
        for i in 0..40 {
            let slope = (above[i] - below[i]) / (2.0 * step);
            let away = (jacobian[(i, j)] - slope).abs();
            assert!(away < 1e-4 * largest, "{i} {j}: {} {slope}", jacobian[(i, j)]);
        }
    }
    response
}

pub(super) fn near(found: &[f64], exact: impl Fn(f64) -> f64, tolerance: f64) {
    for (y, t) in found.iter().zip(times()) {
        assert!((y - exact(t)).abs() < tolerance, "at {t}: {y}, exact {}", exact(t));
    }
}

const OSCILLATOR: &str = r#"
[model]
use = "equations"
state = { y = { start = 0.5, unit = "m" }, v = { start = 0.0, unit = "m/s" } }
rate = { y = "v", v = "supply - 9 {1/s2} * y" }
observe = "y"

[[gap.term]]
use = "forcing"
state = "v"
"#;

/// Landau and Lifshitz, Mechanics, section 22: `c / (w² - W²) cos(W t + phase)` plus the transient from the initial
/// state.
#[test]
fn forcing_drives_as_in_the_textbook() {
    let (c, frequency, phase) = (2.0, 0.3, 0.7);
    let found = response(["m/s2", "m"], OSCILLATOR, &[0.0, c, frequency, phase]);
    let (w, force) = (3.0, TAU * frequency);
    let size: f64 = c / (w * w - force * force);
    let exact = |t: f64| {
        let free = (0.5 - size * f64::cos(phase)) * (w * t).cos()
            + size * force * f64::sin(phase) / w * (w * t).sin();
        free + size * (force * t + phase).cos()
    };
    near(&found, exact, 1e-6);
}

pub(super) const SINGLE: &str = r#"
[model]
use = "equations"
state = { y = { start = START, unit = "K" } }
rate = { y = "supply" }
observe = "y"

[[gap.term]]
state = "y"
"#;

/// `dT/dt = -c (T⁴ - a⁴)`: `c t` is the difference of `(ln((T + a) / (T - a)) + 2 atan(T / a)) / (4 a³)`, by partial
/// fractions.
#[test]
fn radiation_cools_by_the_fourth_power() {
    let (start, ambient, c) = (900.0, 300.0, 4e-10);
    let body = SINGLE.replace("START", "900.0") + "use = \"radiation\"\nambient = \"300 {K}\"\n";
    let found = response(["K/s", "K"], &body, &[0.0, c]);
    let spent = |temperature: f64| {
        let ratio = (temperature + ambient) / (temperature - ambient);
        (ratio.ln() + 2.0 * (temperature / ambient).atan()) / (4.0 * ambient.powi(3))
    };
    for (temperature, t) in found.iter().zip(times()) {
        let away = (spent(*temperature) - spent(start)) / c - t;
        assert!(away.abs() < 1e-5, "at {t}: {temperature}, {away}");
    }
    assert!(found[39] < 700.0);
}

/// `dT/dt = c (1 - exp((T - a) / s))`: `exp(-(T - a) / s)` approaches one exponentially at the rate `c / s`.
#[test]
fn evaporation_cools_by_the_vapour_pressure() {
    let (start, ambient, scale, c) = (350.0, 293.0, 16.0, 0.8);
    let options = "use = \"evaporation\"\nambient = \"293 {K}\"\nscale = \"16 {K}\"\n";
    let body = SINGLE.replace("START", "350.0") + options;
    let found = response(["K/s", "K"], &body, &[0.0, c]);
    let first = f64::exp(-(start - ambient) / scale);
    let exact = |t: f64| ambient - scale * f64::ln_1p((first - 1.0) * (-c * t / scale).exp());
    near(&found, exact, 1e-4);
    assert!(found[39] < 320.0);
}

/// With an unknown scale the coefficient is the loss at the size of the difference along the run.
#[test]
fn evaporation_has_a_scale_of_its_own() {
    let (start, ambient, scale, c) = (350.0, 293.0, 22.0, 0.8);
    let body = SINGLE.replace("START", "350.0") + "use = \"evaporation\"\nambient = \"293 {K}\"\n";
    let loss = c * (size(start, ambient) / scale).exp_m1();
    let found = response(["K/s", "K"], &body, &[0.0, loss, scale]);
    let first = f64::exp(-(start - ambient) / scale);
    let exact = |t: f64| ambient - scale * f64::ln_1p((first - 1.0) * (-c * t / scale).exp());
    near(&found, exact, 1e-4);
}

/// A constant rate adds `c t`.
#[test]
fn a_constant_rate_adds_a_line() {
    let body = SINGLE.replace("START", "2.0") + "use = \"constant_rate\"\n";
    let found = response(["K/s", "K"], &body, &[0.5, -1.25]);
    near(&found, |t| 2.0 - 0.75 * t, 1e-9);
}

/// A vessel that fills at the rate `s` and runs over: `du/dt = s - c w ln(1 + exp((u - h) / w))` reaches `u` after the
/// integral of `du` over the rate, here by Simpson's rule.
#[test]
fn a_vessel_runs_over() {
    let (supply, c, level, width): (f64, f64, f64, f64) = (3.0, 4.0, 2.0, 0.2);
    let body = SINGLE.replace("START", "0.0") + "use = \"overflow\"\nwidth = 0.2\n";
    let found = response(["K/s", "K"], &body, &[supply, c, level]);
    let slowness = |u: f64| 1.0 / (supply - c * width * ((u - level) / width).exp().ln_1p());
    let time = |end: f64| {
        let count = 4000;
        let value = |k: i32| slowness(end * f64::from(k) / f64::from(count));
        let odd: f64 = (1..count).step_by(2).map(value).sum();
        let even: f64 = (2..count).step_by(2).map(value).sum();
        end / f64::from(count) / 3.0 * (value(0) + 4.0 * odd + 2.0 * even + value(count))
    };
    // Later the level hardly changes.
    for (u, t) in found.iter().zip(times()).take_while(|(_, t)| *t < 1.5) {
        assert!((time(*u) - t).abs() < 1e-5, "at {t}: {u} is reached at {}", time(*u));
    }
    // The limit at which the loss is the supply: c w ln(1 + exp((u - h) / w)) = s.
    let limit = level + width * (supply / c / width).exp_m1().ln();
    assert!((found[39] - limit).abs() < 1e-4, "{} {limit}", found[39]);
}

const SPRING: &str = r#"
[model]
use = "equations"
state = { y = { start = 0.5, unit = "m" }, v = { start = 0.0, unit = "m/s" } }
rate = { y = "v", v = "supply" }
observe = "y"

[[gap.term]]
state = "v"
of = "y"
about = "0.2 {m}"
"#;

/// With `z = y - about` the energy `v²/2 + c z³/3` or `v²/2 + c z⁴/4` is conserved: the time from the release at `z0` to a
/// deflection is `integral of dz / v`, by the substitution `z = z0 (1 - s²)` without a singularity.
#[test]
fn stiffness_acts_about_its_equilibrium() {
    let (about, release, c) = (0.2, 0.3_f64, 4.0);
    for (name, power) in [("quadratic_stiffness", 3), ("cubic_stiffness", 4)] {
        let body = format!("{SPRING}use = \"{name}\"\n");
        let found = response(["m/s2", "m"], &body, &[0.0, c]);
        let speed_over_root = |s: f64| {
            // v / s: the difference of the potentials divided by s² is a polynomial without a zero at s = 0.
            let z = release * (1.0 - s * s);
            let fallen = (0..power).map(|k| release.powi(power - 1 - k) * z.powi(k)).sum::<f64>();
            (2.0 * c / f64::from(power) * release * fallen).sqrt()
        };
        let time = |z: f64| {
            let end = (1.0 - z / release).sqrt();
            let count = 2000;
            let value = |k: i32| {
                let s = end * f64::from(k) / f64::from(count);
                2.0 * release / speed_over_root(s)
            };
            let odd: f64 = (1..count).step_by(2).map(value).sum();
            let even: f64 = (2..count).step_by(2).map(value).sum();
            end / f64::from(count) / 3.0 * (value(0) + 4.0 * odd + 2.0 * even + value(count))
        };
        // Up to the passage of the equilibrium.
        let falling: Vec<(f64, f64)> = found
            .iter()
            .zip(times())
            .map(|(y, t)| (y - about, t))
            .take_while(|(z, _)| *z > 0.05)
            .collect();
        assert!(falling.len() > 8, "{found:?}");
        for (z, t) in falling {
            assert!((time(z) - t).abs() < 1e-4, "{name} at {t}: {z} is reached at {}", time(z));
        }
    }
}

const ORBIT: &str = r#"
[model]
use = "equations"
observe = "x"

[model.state]
x = { start = 0.6, unit = "m" }
y = { start = 0.0, unit = "m" }
vx = { start = 0.0, unit = "m/s" }
vy = { start = 2.0, unit = "m/s" }

[model.rate]
x = "vx"
y = "vy"
vx = "supply"
vy = "supply"

[[gap.term]]
use = "pull"
state = "vx"
of = "x"
distance = "hypot(x, y)"
beside = { vy = "y" }
"#;

/// Kepler's ellipse of semi-major axis 1 and eccentricity 0.4 from its pericentre, where the speed is `sqrt(1.4 / 0.6)`
/// times the square root of the coefficient.
#[test]
fn pull_holds_a_body_in_an_ellipse() {
    let (e, c) = (0.4, 4.0 * 0.6 / 1.4);
    let found = response(["m/s2", "m"], ORBIT, &[0.0, c]);
    let exact = |t: f64| {
        let mean = f64::sqrt(c) * t;
        let newton = |anomaly: f64| {
            anomaly - (anomaly - e * anomaly.sin() - mean) / (1.0 - e * anomaly.cos())
        };
        let anomaly = (0..50).fold(mean, |anomaly, _| newton(anomaly));
        anomaly.cos() - e
    };
    near(&found, exact, 1e-5);
}

fn delayed(lags: usize) -> Vec<f64> {
    let options = format!("use = \"delayed\"\nlags = {lags}\n");
    response(["K/s", "K"], &(SINGLE.replace("START", "0.0") + &options), &[SUPPLY, LATE, DELAY])
}

const SUPPLY: f64 = 2.0;
const LATE: f64 = 1.5;
const DELAY: f64 = 2.0;

/// One lag is a linear system of two states; `u - lag` approaches its limit at the rate `c + 1 / delay`.
#[test]
fn one_lag_follows_exponentially() {
    let rate = LATE + 1.0 / DELAY;
    let exact = |t: f64| {
        let gone = (1.0 - (-rate * t).exp()) / rate;
        SUPPLY * t - LATE * SUPPLY / rate * (t - gone)
    };
    near(&delayed(1), exact, 1e-6);
}

/// Many lags approximate a delay: `du/dt = s + c (u(t - d) - u)`, by the method of steps (Smith, An Introduction to
/// Delay Differential Equations, section 1.1). The delays of a chain have variance `d² / n`, which leaves
/// `c s d² / 4 n` at the kink, where the initial state arrives.
#[test]
fn many_lags_are_a_delay() {
    let exact = |t: f64| {
        let level = SUPPLY / LATE;
        let first = level * (1.0 - (-LATE * t).exp());
        let late = (t - DELAY).max(0.0);
        // In the second step `c u(t - d)` contributes: the convolution of the earlier solution with the decay.
        let back = level * (1.0 - (-LATE * late).exp() * (1.0 + LATE * late));
        first + back
    };
    let worst = |lags: usize| {
        let away = delayed(lags).into_iter().zip(times()).map(|(u, t)| (u - exact(t)).abs());
        away.fold(0.0, f64::max)
    };
    let (few, many) = (worst(20), worst(80));
    assert!(many < 1.2 * LATE * SUPPLY * DELAY * DELAY / 320.0, "{many}");
    assert!((0.15..0.5).contains(&(many / few)), "{few} {many}");
}
