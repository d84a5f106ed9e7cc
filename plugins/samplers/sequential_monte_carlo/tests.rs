//! Evidence and draws against closed forms and published values.

use lacuna::contract;
use lacuna::math::moments::{mean, variance};

use super::super::known_evidence::{
    Calibration, assert_evidence, calibration, divergence, peak, regression, run, shells, two_data,
    two_peaks, unit_cube,
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
        assert_eq!(contract::sampler(&format!("{mutation:?}"), &sampler), Ok(()));
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
        assert_evidence(&format!("shells in {dimension}"), &sampler, &shells(dimension), 3);
        let (harvest, _) = run(&sampler, &shells(dimension), 3);
        let right = harvest.points.iter_rows().filter(|x| x[0] > 0.0).count() as f64;
        let share = right / particles as f64;
        // Half of the mass is on either side; the families of particles tell how well it is known.
        let error = 0.5 / harvest.effective_size.sqrt();
        assert!((share - 0.5).abs() < 4.0 * error, "{dimension}: {share} +- {error}");
    }
}

#[test]
fn a_conjugate_normal_posterior_is_found() {
    let mut divergences: Vec<f64> =
        (0..20).map(|seed| divergence(&run(&with(1000), &two_data(), seed).0)).collect();
    divergences.sort_by(f64::total_cmp);
    assert!(divergences[10] < 0.01, "{divergences:?}");
}

#[test]
fn separated_peaks_keep_their_shares() {
    let shares: Vec<f64> = (0..20)
        .map(|seed| {
            let (harvest, _) = run(&with(1000), &two_peaks(), seed);
            let large = harvest.points.iter_rows().filter(|x| x[0] < 0.45).count();
            large as f64 / 1000.0
        })
        .collect();
    let error = (variance(&shares) / 20.0).sqrt();
    assert!((mean(&shares) - 0.75).abs() < 4.0 * error, "{} +- {error}", mean(&shares));
    assert!(error < 0.02, "{error}");
}

#[test]
fn stated_errors_of_the_evidence_hold() {
    for (name, target) in [
        ("two data", two_data()),
        ("regression", regression()),
        ("peak", peak(4, 30.0)),
        ("shells", shells(2)),
    ] {
        let found = calibration(&with(500), &target, 40);
        found.assert(name, 40);
    }
}

#[test]
fn the_effective_size_is_that_of_the_posterior_mean() {
    // Over many runs the mean of the draws scatters by the posterior's width over the root of the size.
    let target = two_data();
    let runs: Vec<_> = (0..60).map(|seed| run(&with(300), &target, seed).0).collect();
    let means: Vec<f64> = runs.iter().map(|h| mean(&h.points.column(0))).collect();
    let sizes: Vec<f64> = runs.iter().map(|h| h.effective_size).collect();
    let real = 0.857_143 / variance(&means);
    let stated = mean(&sizes);
    // The variance of 60 means is known to sqrt(2 / 59) = 18 %.
    assert!((stated / real - 1.0).abs() < 0.6, "stated {stated}, real {real}");
}

#[test]
fn a_founding_like_posterior_costs_a_tenth_of_nested_sampling() {
    // dynesty 3.1.0 needs 387,642 evaluations for an error of 0.30 on a posterior of four unknowns that takes up
    // 30 nats.
    let Calibration { error, evaluations, .. } = calibration(&with(300), &peak(4, 30.0), 10);
    assert!(error < 0.3 && evaluations < 38_000.0, "{error} with {evaluations} evaluations");
}

#[test]
fn too_little_work_is_doubted() {
    let sampler = SequentialMonteCarlo { temperatures: 3, ..with(200) };
    let (harvest, _) = run(&sampler, &peak(4, 30.0), 1);
    assert_eq!(harvest.evidence, None);
    assert!(harvest.doubts[0].contains("short of 1, after 3 temperatures"), "{:?}", harvest.doubts);
    let (harvest, _) = run(&with(60), &peak(6, 60.0), 1);
    let few = "draws of the prior only, too few to know the error";
    assert!(harvest.doubts.iter().any(|d| d.contains(few)), "{:?}", harvest.doubts);
    let (harvest, _) = run(&with(1000), &regression(), 1);
    assert!(harvest.doubts.is_empty(), "{:?}", harvest.doubts);
}

#[test]
fn a_likelihood_that_is_zero_on_most_of_the_prior_is_no_obstacle() {
    let function = |x: &[f64]| if x[0] < 0.02 { 0.0 } else { f64::NEG_INFINITY };
    calibration(&with(200), &unit_cube(2, 0.02_f64.ln(), function), 20).assert("support", 20);
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
    // Without any drawing anew each particle is its own family: the evidence is exact.
    let alone: Vec<usize> = (0..50).collect();
    assert!(genealogy::evidence_variance(&alone, 0).abs() < 1e-14);
    assert!((genealogy::effective_families(&alone) - 50.0).abs() < 1e-12);
    // Two families of equal size: 1 - (2 / 1) (1 - 1/2) = 0 for two particles.
    assert!(genealogy::evidence_variance(&[0, 1], 0).abs() < 1e-14);
    // One family is left: nothing is known.
    assert!((genealogy::evidence_variance(&[3; 50], 1) - 1.0).abs() < 1e-14);
}

#[test]
fn a_run_needs_one_start_a_particle() {
    let target = two_data();
    let points = target.prior_draws(9, &Stream::root(1));
    let message = with(10).start(&target, points).unwrap_err().message;
    assert!(message.contains("for each of 10 chains, found 9 points of 1"), "{message}");
}

#[test]
fn explore() {
    use super::super::known_evidence::{evidence, informative};
    let n: usize = std::env::var("N").map_or(1000, |x| x.parse().unwrap());
    for (name, target) in [
        ("informative 3", informative(3)),
        ("informative 9", informative(9)),
        ("peak", peak(4, 30.0)),
    ] {
        let (mut off, mut errs, mut zs) = (vec![], vec![], vec![]);
        for seed in 0..20 {
            let (h, e) = run(&with(n), &target, seed);
            let (log, err) = evidence(&h);
            off.push(log - target.log_evidence);
            errs.push(err);
            zs.push((log - target.log_evidence) / err);
            if seed < 2 {
                println!(
                    "{name} {:.3} {:.3} {e} {:?} {:?}",
                    log - target.log_evidence,
                    err,
                    h.facts.iter().map(|f| f.value.to_string()).collect::<Vec<_>>(),
                    h.doubts
                );
            }
        }
        println!(
            "{name}: bias {:.3} sd {:.3} stated {:.3}; z mean {:.2} sd {:.2}",
            mean(&off),
            variance(&off).sqrt(),
            mean(&errs),
            mean(&zs),
            variance(&zs).sqrt()
        );
    }
}
