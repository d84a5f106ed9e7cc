//! Evidence and draws against closed forms and published values.

use super::super::known_evidence::{
    Calibration, assert_conjugate, assert_effective_size, assert_evidence, assert_shares,
    assert_support, calibration, informative, peak, regression, run, runs, shells, two_data,
};
use super::*;

fn with(particles: usize) -> SequentialMonteCarlo {
    SequentialMonteCarlo { particles, ..SequentialMonteCarlo::default() }
}

const ALL: [Mutation; 4] = [
    Mutation::Automatic,
    Mutation::RandomWalk,
    Mutation::Independent,
    Mutation::DifferentialEvolution,
];

#[test]
fn it_keeps_the_contract_of_samplers() {
    for mutation in ALL {
        let sampler = SequentialMonteCarlo { mutation, ..with(400) };
        assert_eq!(lacuna_contract::sampler(&format!("{mutation:?}"), &sampler), Ok(()));
    }
}

#[test]
fn evidences_in_closed_form_are_found() {
    for mutation in ALL {
        let sampler = SequentialMonteCarlo { mutation, ..with(8000) };
        assert_evidence(&format!("{mutation:?}, two data"), &sampler, &two_data(), 1);
        assert_evidence(&format!("{mutation:?}, regression"), &sampler, &regression(), 2);
    }
}

#[test]
fn both_shells_are_found_with_the_published_evidence() {
    for (dimension, particles) in [(2, 2000), (5, 4000), (10, 6000)] {
        let sampler = with(particles);
        let name = format!("shells in {dimension}");
        let harvest = assert_evidence(&name, &sampler, &shells(dimension), 3);
        let right = harvest.points.iter_rows().filter(|x| x[0] > 0.0).count() as f64;
        let share = right / particles as f64;
        // Half of the mass is on either side; the effective size tells how accurately the particles give it.
        let error = 0.5 / harvest.effective_size.sqrt();
        assert!((share - 0.5).abs() < 4.0 * error, "{dimension}: {share} +- {error}");
    }
}

#[test]
fn a_conjugate_normal_posterior_is_found() {
    assert_conjugate(&with(1000));
}

#[test]
fn separated_peaks_keep_their_shares() {
    assert_shares(&with(1000), 0.02);
}

#[test]
fn stated_errors_of_the_evidence_hold() {
    for (name, target, particles) in [
        ("two data", two_data(), 500),
        ("regression", regression(), 500),
        ("peak", peak(4, 30.0), 500),
        ("shells", shells(2), 500),
        ("shells in five dimensions", shells(5), 1000),
    ] {
        calibration(&with(particles), &target, runs(40)).assert_close(name);
    }
}

#[test]
fn the_evidence_of_posteriors_as_concentrated_as_the_founding_one_is_found() {
    // As the power grows, the unknown variance and the misfit decrease together through a funnel.
    for (name, unknowns, particles, of_a_night) in
        [("two unknowns", 1, 1000, 40), ("four", 3, 1000, 40), ("ten", 9, 1000, 20)]
    {
        calibration(&with(particles), &informative(unknowns), runs(of_a_night)).assert_close(name);
    }
}

#[test]
fn the_effective_size_is_that_of_the_posterior_mean() {
    assert_effective_size(&with(300));
}

#[test]
fn a_posterior_of_thirty_nats_costs_a_tenth_of_nested_sampling() {
    // dynesty 3.1.0 needs 387,642 evaluations for an error of 0.30 on a posterior of four unknowns with an
    // information gain of 30 nats.
    let Calibration { error, evaluations, .. } = calibration(&with(1000), &peak(4, 30.0), 10);
    let at_equal_error = evaluations * (error / 0.30).powi(2);
    assert!(at_equal_error < 38_800.0, "{error} with {evaluations} evaluations");
}

#[test]
fn too_little_work_is_doubted() {
    let sampler = SequentialMonteCarlo { temperatures: 3, ..with(200) };
    let (harvest, _) = run(&sampler, &peak(4, 30.0), 1);
    assert_eq!(harvest.evidence, None);
    assert!(
        harvest.doubts[0].contains("instead of 1, after 3 temperatures"),
        "{:?}",
        harvest.doubts
    );
    let (harvest, _) = run(&with(60), &peak(6, 60.0), 1);
    let few = "draws of the prior, too few to estimate the error";
    assert!(harvest.doubts.iter().any(|d| d.contains(few)), "{:?}", harvest.doubts);
    let (harvest, _) = run(&with(1000), &regression(), 1);
    assert!(harvest.doubts.is_empty(), "{:?}", harvest.doubts);
}

#[test]
fn a_likelihood_that_is_zero_on_most_of_the_prior_is_no_obstacle() {
    assert_support(&with(200));
}

#[test]
fn the_increase_of_the_power_leaves_the_effective_number() {
    let log_likelihood: Vec<f64> = (0..100).map(|i| -0.5 * f64::from(i * i)).collect();
    let power = temperature::increase(&log_likelihood, 50.0, 1.0);
    let effective = temperature::Weights::new(&log_likelihood, power).effective;
    assert!((effective - 50.0).abs() < 1e-6, "{effective}");
    assert_eq!(temperature::increase(&[1e5; 10], 5.0, 0.25), 0.25);
}

#[test]
fn a_family_tree_gives_the_variance_of_equal_draws() {
    // Without any resampling each particle is its own family: the evidence is exact.
    let alone: Vec<usize> = (0..50).collect();
    assert!(genealogy::evidence_variance(&alone, 0).abs() < 1e-14);
    assert!((genealogy::effective_families(&alone) - 50.0).abs() < 1e-12);
    // Two families of equal size: 1 - (2 / 1) (1 - 1/2) = 0 for two particles.
    assert!(genealogy::evidence_variance(&[0, 1], 0).abs() < 1e-14);
    // With one family left, nothing is known.
    assert!((genealogy::evidence_variance(&[3; 50], 1) - 1.0).abs() < 1e-14);
}

#[test]
fn a_run_needs_one_start_a_particle() {
    let target = two_data();
    let points = target.prior_draws(9, &Stream::root(1));
    let message = with(10).start(&target, points).unwrap_err().message;
    assert!(message.contains("for each of 10 chains, found 9 points of 1"), "{message}");
}
