//! Published test functions on the unit cube.

use std::f64::consts::PI;

use crate::surrogates::polynomial_chaos::tests::functions;

fn scaled<const D: usize>(u: &[f64], ranges: [[f64; 2]; D]) -> [f64; D] {
    std::array::from_fn(|k| ranges[k][0] + u[k] * (ranges[k][1] - ranges[k][0]))
}

/// Flow through a borehole (Harper and Gupta 1983; Morris, Mitchell and Ylvisaker 1993).
pub fn borehole(u: &[f64]) -> f64 {
    let function = functions::borehole();
    let places = function.designs.iter().zip(u).map(|(design, u)| design.quantile(*u));
    (function.value)(&places.collect::<Vec<f64>>())
}

/// Midpoint voltage of an output transformerless circuit (Ben-Ari and Steinberg 2007).
pub fn circuit(u: &[f64]) -> f64 {
    let [rb1, rb2, rf, rc1, rc2, beta] = scaled(
        u,
        [[50.0, 150.0], [25.0, 70.0], [0.5, 3.0], [1.2, 2.5], [0.25, 1.2], [50.0, 300.0]],
    );
    let (base, gain) = (12.0 * rb2 / (rb1 + rb2), beta * (rc2 + 9.0));
    ((base + 0.74) * gain + 11.35 * rf + 0.74 * rf * gain / rc1) / (gain + rf)
}

/// Cycle time of a piston (Kenett and Zacks 1998).
pub fn piston(u: &[f64]) -> f64 {
    let [m, s, v0, k, p0, ta, t0] = scaled(
        u,
        [
            [30.0, 60.0],
            [0.005, 0.020],
            [0.002, 0.010],
            [1000.0, 5000.0],
            [90_000.0, 110_000.0],
            [290.0, 296.0],
            [340.0, 360.0],
        ],
    );
    let (a, gas) = (p0 * s + 19.62 * m - k * v0 / s, p0 * v0 / t0 * ta);
    let v = s / (2.0 * k) * ((a * a + 4.0 * k * gas).sqrt() - a);
    2.0 * PI * (m / (k + s * s * gas / (v * v))).sqrt()
}

/// Weight of the wing of a light aircraft (Forrester, Sóbester and Keane 2008).
pub fn wing_weight(u: &[f64]) -> f64 {
    let [area, fuel, aspect, sweep, q, taper, thick, load, gross, paint] = scaled(
        u,
        [
            [150.0, 200.0],
            [220.0, 300.0],
            [6.0, 10.0],
            [-10.0, 10.0],
            [16.0, 45.0],
            [0.5, 1.0],
            [0.08, 0.18],
            [2.5, 6.0],
            [1700.0, 2500.0],
            [0.025, 0.08],
        ],
    );
    let cosine = sweep.to_radians().cos();
    let shape = (aspect / (cosine * cosine)).powf(0.6) * q.powf(0.006) * taper.powf(0.04);
    let profile = (100.0 * thick / cosine).powf(-0.3) * (load * gross).powf(0.49);
    0.036 * area.powf(0.758) * fuel.powf(0.0035) * shape * profile + area * paint
}

/// Function of ten parameters, five of which do nothing (Friedman 1991).
pub fn friedman(u: &[f64]) -> f64 {
    let waves = 10.0 * (PI * u[0] * u[1]).sin() + 20.0 * (u[2] - 0.5).powi(2);
    waves + 10.0 * u[3] + 5.0 * u[4]
}

/// Values at the centres of the cubes, by hand.
#[test]
fn values_at_the_centres() {
    let centre = [0.5; 10];
    assert!((borehole(&centre) - 71.34).abs() < 0.5, "{}", borehole(&centre));
    assert!((friedman(&centre) - (10.0 * (PI / 4.0).sin() + 7.5)).abs() < 1e-12);
    assert!((4.0..6.0).contains(&circuit(&centre)), "{}", circuit(&centre));
    assert!((0.3..0.7).contains(&piston(&centre)), "{}", piston(&centre));
    assert!((250.0..280.0).contains(&wing_weight(&centre)), "{}", wing_weight(&centre));
}
