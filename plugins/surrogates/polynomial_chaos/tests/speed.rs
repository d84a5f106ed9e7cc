//! How long fits of the founding study's size take: run by hand with `--ignored --nocapture`.

use std::time::Instant;

use lacuna::linalg::Matrix;
use lacuna::plugin::Emulator;

use super::bench::{fitted, latin_hypercube, scaled};
use crate::surrogates::polynomial_chaos::{PolynomialChaos, Solver};
use crate::surrogates::principal_components::Components;

const OUTPUTS: usize = 1000;
const BOX: [[f64; 2]; 3] = [[0.0, 1.5e7], [1.1e4, 1.4e4], [1200.0, 1800.0]];

/// The strain of a damped wave that arrives at ten sensors one after the other, with a kink that no
/// polynomial describes well.
fn wave(unit: &[f64], output: usize) -> f64 {
    let (sensor, time) = ((output / 100) as f64, (output % 100) as f64 / 100.0);
    let [cutoff, density, speed] = [unit[0], 1.0 + 0.36 * unit[1], 1.2 + unit[2]];
    let since = time - 0.05 * sensor / speed;
    let envelope = 1.0 / (1.0 + (-40.0 * since).exp()) * (-since * (2.0 + cutoff)).exp();
    let kink = 3e-6 * (unit[0] + time - 0.7 * unit[1]).abs();
    1e-4 * density * envelope * ((9.0 + sensor) * speed * since / density).sin() + kink
}

#[test]
#[ignore = "takes a minute"]
fn a_thousand_outputs_on_one_core() {
    let unit = latin_hypercube(480, 3, 11);
    let points = scaled(&unit, &BOX);
    let responses = Matrix::from_fn(480, OUTPUTS, |i, o| wave(unit.row(i), o));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let plain = PolynomialChaos::default();
    let components = Some(Components::Variance(0.999_999));
    let matching = Solver::OrthogonalMatchingPursuit;
    for (name, options) in [
        ("least-angle regression", plain.clone()),
        ("the same on principal components", PolynomialChaos { components, ..plain.clone() }),
        ("matching pursuit", PolynomialChaos { solver: matching, ..plain }),
    ] {
        let start = Instant::now();
        let fit = pool.install(|| fitted(&options, &BOX, &points, &responses).unwrap());
        let seconds = start.elapsed().as_secs_f64();
        let mut errors = fit.fit_error().relative.clone();
        errors.sort_by(f64::total_cmp);
        let terms = fit.summary().terms.iter().sum::<usize>() / fit.summary().terms.len();
        println!("{name}: {seconds:.1} s, {terms} terms, median error {:.1e}", errors[OUTPUTS / 2]);
    }
}
