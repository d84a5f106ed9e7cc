//! Evidence and draws against closed forms and published values.

use super::super::known_evidence::{
    assert_conjugate, assert_effective_size, assert_evidence, assert_shares, assert_support,
    calibration, informative, peak, regression, run, runs, shells, two_data, unit_cube,
};
use super::*;

fn with(live: usize) -> Nested {
    Nested { live, ..Nested::default() }
}

#[test]
fn it_keeps_the_contract_of_samplers() {
    for mutation in [Mutation::DifferentialEvolution, Mutation::Automatic] {
        let sampler = Nested { mutation, ..with(300) };
        assert_eq!(lacuna_contract::sampler(&format!("{mutation:?}"), &sampler), Ok(()));
    }
}

#[test]
fn evidences_in_closed_form_are_found() {
    assert_evidence("two data", &with(1000), &two_data(), 1);
    assert_evidence("regression", &with(3000), &regression(), 2);
    let sampler = Nested { mutation: Mutation::Automatic, correlation: 0.05, ..with(3000) };
    assert_evidence("regression by turns", &sampler, &regression(), 3);
    let sampler = Nested { mutation: Mutation::RandomWalk, ..with(3000) };
    assert_evidence("regression by random walks", &sampler, &regression(), 4);
}

#[test]
fn both_shells_are_found_with_the_published_evidence() {
    for (dimension, live, seed) in [(2, 2000, 1), (5, 3000, 2), (10, 4000, 4)] {
        let sampler = with(live);
        let name = format!("shells in {dimension}");
        let harvest = assert_evidence(&name, &sampler, &shells(dimension), seed);
        let right = harvest.points.iter_rows().filter(|x| x[0] > 0.0).count() as f64;
        let share = right / harvest.points.rows() as f64;
        assert!((share - 0.5).abs() < 0.1, "{dimension}: {share}");
    }
}

#[test]
fn a_conjugate_normal_posterior_is_found() {
    assert_conjugate(&with(500));
}

#[test]
fn separated_peaks_keep_their_shares() {
    assert_shares(&with(400), 0.03);
}

#[test]
fn stated_errors_of_the_evidence_hold() {
    for (name, target) in [("two data", two_data()), ("regression", regression())] {
        calibration(&with(300), &target, runs(40)).assert_close(name);
    }
    for (name, target) in [("peak", peak(4, 30.0)), ("founding shape", informative(3))] {
        calibration(&with(300), &target, runs(60)).assert(name);
    }
}

#[test]
fn the_effective_size_is_that_of_the_posterior_mean() {
    assert_effective_size(&with(200));
}

#[test]
fn evidence_and_information_are_those_of_the_peak() {
    let (harvest, _) = run(&with(500), &peak(4, 30.0), 1);
    let information = &harvest.facts[0];
    assert!(information.name.starts_with("information"));
    let found: f64 = information.value.parse().unwrap();
    let error = harvest.evidence.unwrap().error;
    assert!((found - 30.0).abs() < 4.0 * error, "{found} +- {error}");
}

#[test]
fn too_little_work_is_doubted() {
    let sampler = Nested { halvings: 3, ..with(200) };
    let (harvest, _) = run(&sampler, &peak(4, 30.0), 1);
    assert_eq!(harvest.evidence, None);
    assert!(harvest.doubts[0].contains("after 3 halvings"), "{:?}", harvest.doubts);
    // A single small move leaves new points next to their parents, where the likelihood is behind.
    let sampler = Nested { mutation: Mutation::RandomWalk, moves: 1, ..with(1000) };
    let (harvest, _) = run(&sampler, &peak(10, 60.0), 1);
    let uneven = "among the live points are not uniform";
    assert!(harvest.doubts.iter().any(|d| d.contains(uneven)), "{:?}", harvest.facts);
    let (harvest, _) = run(&with(500), &regression(), 1);
    assert!(harvest.doubts.is_empty(), "{:?}", harvest.doubts);
}

#[test]
fn equal_likelihoods_are_no_obstacle() {
    // The likelihood is one on half of the prior and e^-5 on the other half: Z = (1 + e^-5) / 2.
    let function = |x: &[f64]| if x[0] < 0.5 { 0.0 } else { -5.0 };
    let expected = 0.5 * (1.0 + (-5.0_f64).exp());
    calibration(&with(400), &unit_cube(1, expected.ln(), function), 20).assert("plateaus");
}

#[test]
fn a_likelihood_that_is_zero_on_most_of_the_prior_is_no_obstacle() {
    assert_support(&with(200));
}
