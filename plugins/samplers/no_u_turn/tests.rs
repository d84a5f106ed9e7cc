//! Complete runs against known moments, and the reports of failure.

use lacuna::diagnose::chains::ess_bulk;

use super::*;
use crate::samplers::hamiltonian::laws::{
    assert_banana, assert_moments, assert_stationary, complaints_about, conjugate, funnel,
    median_divergence, run, scaled,
};

#[test]
fn it_keeps_the_contract_of_samplers() {
    for metric in [None, Some(Shape::Diagonal)] {
        let sampler = NoUTurn { steps: 2000, warm_up: 300, metric, ..NoUTurn::default() };
        assert_eq!(lacuna_contract::sampler("no_u_turn", &sampler), Ok(()));
    }
}

#[test]
fn known_moments_come_out() {
    assert_moments(&NoUTurn { steps: 4000, ..NoUTurn::default() });
    // The ridge narrows away from its bend, where larger steps would diverge.
    assert_banana(&NoUTurn { steps: 4000, target_acceptance: 0.99, ..NoUTurn::default() });
}

#[test]
fn draws_stay_draws_whatever_the_step() {
    for (step, depth) in [(0.15, 10), (0.6, 10), (0.3, 2)] {
        assert_stationary(|flow, point, rng| tree::transition(flow, point, step, depth, rng));
    }
}

#[test]
fn a_conjugate_normal_posterior_is_found() {
    let sampler = NoUTurn { steps: 600, warm_up: 200, ..NoUTurn::default() };
    let median = median_divergence(|seed| run(&sampler, &conjugate(), seed).0.pooled(0));
    assert!(median < 0.01, "{median}");
}

#[test]
fn draws_of_ten_correlated_unknowns_of_any_scale_are_nearly_independent() {
    let (draws, state) = run(&NoUTurn::default(), &scaled(), 5);
    for j in 0..10 {
        let size = ess_bulk(&draws.coordinate(j).collect::<Vec<_>>());
        assert!(size > 0.5 * draws.len() as f64, "{j}: {size} of {}", draws.len());
    }
    // With the metric learnt, a trajectory of a ten-dimensional normal density takes about seven gradients.
    assert!(state.evaluations < 4 * 2000 * 14, "{}", state.evaluations);
}

#[test]
fn a_funnel_diverges_and_says_so() {
    let sampler = NoUTurn { steps: 1500, ..NoUTurn::default() };
    let (_, state) = run(&sampler, &funnel(), 6);
    let doubts = sampler.doubts(&state);
    assert!(doubts.iter().any(|d| d.contains("diverged") && d.contains("of 2000")), "{doubts:?}");
}

#[test]
fn a_single_divergence_is_a_note_and_many_are_a_doubt() {
    let sampler = NoUTurn { steps: 600, warm_up: 100, ..NoUTurn::default() };
    let (_, mut state) = run(&sampler, &scaled(), 6);
    assert!(sampler.doubts(&state).is_empty() && sampler.notes(&state).is_empty());
    for (divergences, doubted) in [(1, false), (3, false), (4, true)] {
        state.memory["chains"][0]["divergences"] = divergences.into();
        let told = format!("{divergences} of 2000 trajectories after the warm-up (0.");
        let (yes, no) = if doubted {
            (sampler.doubts(&state), sampler.notes(&state))
        } else {
            (sampler.notes(&state), sampler.doubts(&state))
        };
        assert!(no.is_empty() && yes.len() == 1 && yes[0].contains(&told), "{yes:?} {no:?}");
    }
}

#[test]
fn trajectories_that_are_cut_off_are_told() {
    let sampler = NoUTurn { depth: 1, steps: 300, warm_up: 100, ..NoUTurn::default() };
    let (_, state) = run(&sampler, &scaled(), 7);
    let doubts = sampler.doubts(&state);
    assert!(doubts.iter().any(|d| d.contains("cut off")), "{doubts:?}");
}

#[test]
fn options_that_make_no_sense_are_refused() {
    for (text, expected) in [
        ("depth = 0", "no or too many steps"),
        ("depth = 21", "no or too many steps"),
        ("warm_up = 19", "at least 20"),
    ] {
        let found = complaints_about::<NoUTurn>(text);
        assert!(found.contains(expected), "{text}: {found}");
    }
    assert_eq!(complaints_about::<NoUTurn>("metric = \"diagonal\""), "");
}
