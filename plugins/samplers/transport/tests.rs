//! The map's derivatives, and complete runs against known moments where the coordinates of `no_u_turn` fail.

use lacuna::diagnose::chains::ess_bulk;
use lacuna::math::random::normal;

use super::*;
use crate::samplers::hamiltonian::laws::{
    Law, assert_banana, assert_mean, assert_moments, complaints_about, funnel, run, scaled,
};
use crate::samplers::no_u_turn::NoUTurn;

#[test]
fn it_keeps_the_contract_of_samplers() {
    let sampler = Transport { steps: 2000, warm_up: 600, ..Transport::default() };
    assert_eq!(lacuna_contract::sampler("transport", &sampler), Ok(()));
}

#[test]
fn known_moments_come_out() {
    assert_moments(&Transport { steps: 4500, ..Transport::default() });
    assert_banana(&Transport { steps: 4500, target_acceptance: 0.9, ..Transport::default() });
}

/// Neal's funnel (Annals of Statistics 31 (2003) 705, section 8): v ~ N(0, 9), and nine coordinates of scale exp(v / 2).
/// `no_u_turn` diverges in its neck and does not find the moments of v.
#[test]
fn the_neck_of_a_funnel_is_visited() {
    let sampler = Transport { steps: 5000, warm_up: 2000, ..Transport::default() };
    let (draws, state) = run(&sampler, &funnel(), 6);
    assert_mean(&draws, "mean of v", 0.0, 3.0, |x| x[0]);
    assert_mean(&draws, "variance of v", 9.0, 9.0, |x| x[0] * x[0]);
    // The tenth and the first percentile, of which the second is deep in the neck.
    for (z, share, scale) in [(-1.281_551_565_544_6, 0.1, 0.1), (-2.326_347_874_040_8, 0.01, 0.03)]
    {
        assert_mean(&draws, "share below", share, scale, |x| f64::from(u8::from(x[0] < 3.0 * z)));
    }
    assert_eq!(sampler.doubts(&state), Vec::<String>::new());
    let plain = NoUTurn { steps: 5000, target_acceptance: 0.9, ..NoUTurn::default() };
    let (draws, _) = run(&plain, &funnel(), 6);
    let deep = draws.coordinate(0).flatten().filter(|v| *v < 3.0 * -2.326).count();
    assert!((deep as f64) < 0.005 * draws.len() as f64, "{deep} of {}", draws.len());
}

/// A map has no terms for what is not bent.
#[test]
fn a_normal_density_needs_no_curved_map() {
    let sampler = Transport::default();
    let (draws, state) = run(&sampler, &scaled(), 5);
    let map = serde_json::from_value::<Memory>(state.memory.clone()).unwrap().map.unwrap();
    assert_eq!(map.count(Form::Curved), 0, "{:?}", sampler.notes(&state));
    for j in 0..10 {
        let size = ess_bulk(&draws.coordinate(j).collect::<Vec<_>>());
        assert!(size > 0.5 * draws.len() as f64, "{j}: {size} of {}", draws.len());
    }
}

/// Two normal densities far from each other: the chains stay where they began, and no map is made of both.
#[test]
fn chains_that_disagree_teach_no_map() {
    let two = Law::free(vec![[0.0, 100.0], [0.0, 1.0]], |x: &[f64]| {
        let off = x[0] - 100.0_f64.copysign(x[0]);
        (-0.5 * (off * off + x[1] * x[1]), vec![-off, -x[1]])
    });
    let sampler = Transport { steps: 700, warm_up: 600, ..Transport::default() };
    let (draws, state) = run(&sampler, &two, 4);
    let signs: Vec<bool> = (0..4).map(|chain| draws.point(chain, 0)[0] > 0.0).collect();
    assert!(signs.contains(&true) && signs.contains(&false), "both are visited: {signs:?}");
    assert!(sampler.notes(&state).iter().any(|note| note.contains("no map was learnt")));
}

/// Draws in which place and scale of each coordinate depend on others.
fn bent() -> Matrix {
    let mut rng = Stream::root(3).generator();
    let mut draws = Matrix::zeros(0, 3);
    for _ in 0..400 {
        let a = 2.0 + normal(&mut rng);
        let b = a * a + 0.5 * normal(&mut rng);
        draws.push_row(&[b, 10.0 * (0.4 * a).exp() * normal(&mut rng), a]);
    }
    draws
}

#[test]
fn the_map_and_its_inverse_agree_and_its_derivatives_are_those_of_differences() {
    let map = Map::of(&bent(), 1).unwrap();
    let z = [0.3, -1.1, 0.7];
    let (free, _) = map.free(&z);
    for (back, z) in map.transported(&free).iter().zip(z) {
        assert!((back - z).abs() < 1e-12, "{back} {z}");
    }
    // The density exp(a u1 + b u2² + c u3), with the determinant of the map.
    let value = |z: &[f64]| {
        let (u, log) = map.free(z);
        0.3 * u[0] - 1e-3 * u[1] * u[1] + 0.2 * u[2] + log
    };
    let given = map.pulled(&z, &[0.3, -2e-3 * free[1], 0.2]);
    for j in 0..3 {
        let moved = |by: f64| {
            let mut place = z;
            place[j] += by;
            value(&place)
        };
        let found = (moved(1e-5) - moved(-1e-5)) / 2e-5;
        assert!(
            (given[j] - found).abs() < 1e-7 * found.abs().max(1.0),
            "{j}: {} {found}",
            given[j]
        );
    }
}

/// The determinant against that of the matrix of differences.
#[test]
fn the_determinant_is_that_of_the_map() {
    let map = Map::of(&bent(), 1).unwrap();
    let z = [0.3, -1.1, 0.7];
    let column = |j: usize| {
        let moved = |by: f64| {
            let mut place = z;
            place[j] += by;
            map.free(&place).0
        };
        let (above, below) = (moved(1e-5), moved(-1e-5));
        (0..3).map(|i| (above[i] - below[i]) / 2e-5).collect::<Vec<f64>>()
    };
    let c: Vec<Vec<f64>> = (0..3).map(column).collect();
    let determinant = c[0][0] * (c[1][1] * c[2][2] - c[2][1] * c[1][2])
        - c[1][0] * (c[0][1] * c[2][2] - c[2][1] * c[0][2])
        + c[2][0] * (c[0][1] * c[1][2] - c[1][1] * c[0][2]);
    assert!((determinant.abs().ln() - map.free(&z).1).abs() < 1e-8);
}

#[test]
fn options_that_make_no_sense_are_refused() {
    for (text, expected) in [
        ("depth = 0", "no or too many steps"),
        ("warm_up = 100", "at least 150"),
        ("steps = 1500", "all steps are warm-up"),
    ] {
        let found = complaints_about::<Transport>(text);
        assert!(found.contains(expected), "{text}: {found}");
    }
}
