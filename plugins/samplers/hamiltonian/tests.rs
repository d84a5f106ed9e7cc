//! Trajectories against closed forms, and complete runs against known moments.

use lacuna::math::transform::Unconstrained;
use lacuna_linalg::vector::norm;

use super::laws::{
    assert_banana, assert_moments, assert_stationary, banana, complaints_about, conjugate,
    median_divergence, run, scaled,
};
use super::metric::Metric;
use super::*;

#[test]
fn it_keeps_the_contract_of_samplers() {
    for metric in [None, Some(Shape::Diagonal)] {
        let sampler = Hamiltonian { steps: 2000, warm_up: 300, metric, ..Hamiltonian::default() };
        assert_eq!(lacuna_contract::sampler("hamiltonian", &sampler), Ok(()));
    }
}

#[test]
fn known_moments_come_out() {
    assert_moments(&Hamiltonian { steps: 4000, ..Hamiltonian::default() });
    // The ridge narrows away from its bend, where larger steps would diverge.
    assert_banana(&Hamiltonian { steps: 4000, target_acceptance: 0.99, ..Hamiltonian::default() });
}

#[test]
fn draws_stay_draws_whatever_the_step() {
    for (step, trajectory) in [(0.15, Trajectory::Time(1.5)), (0.6, Trajectory::LeapfrogSteps(3))] {
        let sampler = Hamiltonian { trajectory, ..Hamiltonian::default() };
        assert_stationary(|flow, point, rng| sampler.coast(flow, point, step, rng));
    }
}

#[test]
fn a_conjugate_normal_posterior_is_found() {
    let sampler = Hamiltonian { steps: 600, warm_up: 200, ..Hamiltonian::default() };
    let median = median_divergence(|seed| run(&sampler, &conjugate(), seed).0.pooled(0));
    assert!(median < 0.01, "{median}");
}

#[test]
fn a_trajectory_goes_back_the_way_it_came() {
    let law = banana();
    let target = Unconstrained::new(&law);
    let metric = Metric::Dense(Matrix::from_rows(2, [[0.7, 0.0], [0.4, 1.1]]));
    let flow = Flow { target: &target, metric: &metric };
    let from = Point::at(&target, vec![0.3, 0.9]);
    let mut phase = flow.push(&from, &mut Stream::root(1).generator());
    let start = phase.clone();
    (0..40).for_each(|_| flow.leapfrog(&mut phase, 0.05));
    assert!(phase.point.place != start.point.place);
    phase.momentum.iter_mut().for_each(|z| *z = -*z);
    (0..40).for_each(|_| flow.leapfrog(&mut phase, 0.05));
    let off = |a: &[f64], b: &[f64], sign: f64| {
        norm(&a.iter().zip(b).map(|(a, b)| a - sign * b).collect::<Vec<_>>())
    };
    assert!(off(&phase.point.place, &start.point.place, 1.0) < 1e-12);
    assert!(off(&phase.momentum, &start.momentum, -1.0) < 1e-12);
}

#[test]
fn the_energy_error_falls_with_the_square_of_the_step() {
    let law = scaled();
    let target = Unconstrained::new(&law);
    let metric = Metric::Diagonal((0..10).map(super::laws::scale).collect());
    let flow = Flow { target: &target, metric: &metric };
    let place = (0..10).map(|j| laws::scale(j) * (10.0 * j as f64 + 0.5)).collect();
    let from = Point::at(&target, place);
    let error = |halvings: u32| {
        let (step, count) = (0.1 / f64::from(1 << halvings), 13 << halvings);
        let mut phase = flow.push(&from, &mut Stream::root(2).generator());
        let energy = phase.energy();
        (0..count).for_each(|_| flow.leapfrog(&mut phase, step));
        phase.energy() - energy
    };
    for halvings in 0..4 {
        let ratio = error(halvings) / error(halvings + 1);
        assert!((ratio - 4.0).abs() < 0.5, "{halvings}: {ratio}");
    }
}

#[test]
fn the_first_metric_is_the_covariance_of_a_normal_law() {
    let law = scaled();
    let target = Unconstrained::new(&law);
    // Two points far outside the bulk: the curvature of a normal density is the same everywhere.
    let places: Vec<Vec<f64>> =
        [-40.0, 300.0].map(|z| (0..10).map(|j| z * laws::scale(j)).collect()).to_vec();
    let places: Vec<&[f64]> = places.iter().map(|p| &p[..]).collect();
    let found = curvature::covariance(&target, &places).covariance;
    for i in 0..10 {
        for j in 0..10 {
            let units = laws::scale(i) * laws::scale(j);
            let expected = 0.8_f64.powi((i as i32 - j as i32).abs());
            let entry = found[(i, j)] / units;
            assert!((entry - expected).abs() < 1e-4, "{i}, {j}: {entry} and {expected}");
        }
    }
}

/// Returns the mean acceptance rate after the warm-up.
fn acceptance(sampler: &Hamiltonian, target: &dyn Target) -> f64 {
    let (draws, _) = run(sampler, target, 4);
    let shares = lacuna::diagnose::walkers::acceptance(&draws);
    shares.iter().sum::<f64>() / shares.len() as f64
}

#[test]
fn the_step_size_reaches_the_target_acceptance() {
    for target_acceptance in [0.7, 0.8, 0.95] {
        let sampler = Hamiltonian { target_acceptance, ..Hamiltonian::default() };
        let found = acceptance(&sampler, &scaled());
        assert!((found - target_acceptance).abs() < 0.1, "{found} and {target_acceptance}");
    }
    let trajectory = Trajectory::LeapfrogSteps(8);
    let found = acceptance(&Hamiltonian { trajectory, ..Hamiltonian::default() }, &banana());
    assert!((found - 0.8).abs() < 0.1, "{found}");
}

#[test]
fn options_that_make_no_sense_are_refused() {
    for (text, expected) in [
        ("chains = 0", "no chains"),
        ("warm_up = 5", "at least 20"),
        ("steps = 1000", "more than `warm_up`"),
        ("target_acceptance = 1.0", "no step size"),
        ("jitter = 1.0", "from 0 to below 1"),
        ("trajectory = { time = 0.0 }", "chains would not move"),
        ("trajectory = { leapfrog_steps = 0 }", "chains would not move"),
    ] {
        let found = complaints_about::<Hamiltonian>(text);
        assert!(found.contains(expected), "{text}: {found}");
    }
    assert_eq!(complaints_about::<Hamiltonian>("metric = \"dense\""), "");
}
