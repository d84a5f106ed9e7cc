//! Diagnostics against ArviZ 0.23.4 and emcee 3.1.6, and on planted failures.
//!
//! `tests/samples/diagnose_chains.csv` and the numbers below are made by this script (numpy 2.4):
//!
//! ```text
//! import numpy as np, arviz as az, emcee
//! rng = np.random.default_rng(1)
//! chains, steps = 4, 150
//! def ar(rho, noise):
//!     x = np.zeros((chains, steps)); x[:, 0] = noise((chains,))
//!     for t in range(1, steps): x[:, t] = rho * x[:, t - 1] + np.sqrt(1 - rho**2) * noise((chains,))
//!     return x
//! columns = [ar(0.7, rng.standard_normal), ar(0.9, rng.standard_normal) + np.arange(chains)[:, None],
//!            ar(-0.4, lambda s: rng.standard_t(3, s)) * np.array([1, 1, 1, 2])[:, None], np.floor(3 * ar(0.3, rng.standard_normal))]
//! columns = [np.round(c, 4) for c in columns]
//! with open("chains.csv", "w") as f:
//!     f.write("chain,step,a,b,c,d\n")
//!     for k in range(chains):
//!         for t in range(steps): f.write(f"{k},{t}," + ",".join(f"{c[k, t]:g}" for c in columns) + "\n")
//! for c in columns:
//!     e = lambda method, **a: float(az.ess(c, method=method, **a))
//!     m = lambda method, **a: float(az.mcse(c, method=method, **a))
//!     print([float(az.rhat(c)), e("bulk"), e("tail"), e("mean"), e("quantile", prob=0.3), m("mean"), m("sd"), m("quantile", prob=0.9),
//!            float(emcee.autocorr.integrated_time(c.T, quiet=True)[0])])
//! ```

// Reference values keep the digits that the programs print.
#![allow(clippy::unreadable_literal)]

use super::*;
use crate::math::random::{Stream, normal};

/// Per column: R-hat, ESS (bulk, tail, mean, quantile 0.3), MCSE (mean, sd, quantile 0.9), tau.
const EXPECTED: [[f64; 9]; 4] = [
    [
        1.0344100900109565,
        121.06594172610477,
        253.70772213142465,
        121.30604825458275,
        158.48198756966252,
        0.08558558743705058,
        0.042381558959526174,
        0.1604,
        5.107160083403819,
    ],
    [
        1.6078678276134182,
        7.101173436802721,
        26.393586651663544,
        6.713467094383906,
        8.919829256964215,
        0.5696992952800478,
        0.16641487615561376,
        0.26585000000000014,
        7.531233905417238,
    ],
    [
        1.0578817968458682,
        1666.890750230186,
        500.550825198392,
        1666.890750230186,
        989.4437808581025,
        0.04754953988597641,
        0.19236006745456516,
        0.2398499999999999,
        0.09706746658974663,
    ],
    [
        1.0084471369447137,
        277.16703354482894,
        406.4674215757965,
        279.0426605320804,
        327.95652555669346,
        0.18744022612000555,
        0.10227455951295455,
        0.0,
        2.170768541510867,
    ],
];

fn column(j: usize) -> Vec<Vec<f64>> {
    let text = include_str!("../../../../tests/samples/diagnose_chains.csv");
    let values: Vec<f64> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').nth(j + 2).unwrap().parse().unwrap())
        .collect();
    values.chunks(150).map(<[f64]>::to_vec).collect()
}

#[test]
fn chains_are_judged_as_by_arviz_and_emcee() {
    for (j, expected) in EXPECTED.iter().enumerate() {
        let c = column(j);
        let found = [
            chains::r_hat(&c),
            chains::ess_bulk(&c),
            chains::ess_tail(&c),
            chains::ess_mean(&c),
            chains::ess_quantile(&c, 0.3),
            chains::mcse_mean(&c),
            chains::mcse_sd(&c),
            chains::mcse_quantile(&c, 0.9),
            autocorrelation::integrated_time(&c),
        ];
        for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
            let near = (found - expected).abs() <= 1e-9 * expected.abs();
            assert!(near, "column {j}, number {k}: {found} and not {expected}");
        }
    }
}

#[test]
fn what_cannot_be_judged_is_not_a_number() {
    assert!(chains::r_hat(&[vec![1.0, 2.0, 3.0, 4.0]]).is_nan());
    assert!(chains::r_hat(&[vec![1.0; 3], vec![2.0; 3]]).is_nan());
    assert!(chains::ess_bulk(&[vec![1.0, f64::NAN, 3.0, 4.0, 5.0]]).is_nan());
    assert!(autocorrelation::integrated_time(&[vec![1.0; 9]]).is_nan());
    assert!(chains::mcse_quantile(&[vec![]], 0.5).is_nan());
}

/// Walkers with a standard normal law in `dimension` coordinates, each an AR(1) chain with correlation `rho` between
/// steps.
fn healthy(dimension: usize, chains: usize, steps: usize, rho: f64, seed: u64) -> Draws {
    let names = (0..dimension).map(|j| format!("x{j}")).collect();
    let mut draws = Draws { names, chains, steps, values: Vec::new(), log_density: Vec::new() };
    for chain in 0..chains {
        let mut rng = Stream::root(seed).at(chain as u64).generator();
        let mut point: Vec<f64> = (0..dimension).map(|_| normal(&mut rng)).collect();
        for _ in 0..steps {
            for x in &mut point {
                *x = rho * *x + (1.0 - rho * rho).sqrt() * normal(&mut rng);
            }
            draws.log_density.push(-0.5 * point.iter().map(|x| x * x).sum::<f64>());
            draws.values.extend_from_slice(&point);
        }
    }
    draws
}

fn lower(draws: &mut Draws, chain: usize, steps: std::ops::Range<usize>, by: f64) {
    for step in steps {
        draws.log_density[chain * draws.steps + step] -= by;
    }
}

#[test]
fn no_walker_of_a_healthy_ensemble_is_stranded() {
    // Slowly moving walkers in up to 40 coordinates, forty ensembles of 100 walkers.
    for seed in 0..10 {
        for (dimension, rho) in [(1, 0.9), (5, 0.95), (20, 0.98), (40, 0.98)] {
            let draws = healthy(dimension, 100, 80, rho, seed);
            assert_eq!(Stranded::among(&draws), Stranded::default(), "{dimension}, {seed}");
        }
    }
}

#[test]
fn heavy_tails_strand_no_walker() {
    // A Cauchy law: independent draws reach log densities twenty below the mode.
    let mut draws = healthy(1, 100, 200, 0.0, 3);
    for (x, log_density) in draws.values.iter_mut().zip(&mut draws.log_density) {
        *x = (std::f64::consts::PI * (crate::math::special::normal_cdf(*x) - 0.5)).tan();
        *log_density = -(1.0 + *x * *x).ln();
    }
    assert!(draws.log_density.iter().any(|l| *l < -15.0));
    assert_eq!(Stranded::among(&draws), Stranded::default());
}

#[test]
fn planted_stranded_walkers_are_found_even_when_they_are_most() {
    let mut draws = healthy(4, 100, 100, 0.9, 5);
    for chain in 0..93 {
        lower(&mut draws, chain, 0..100, 50.0);
    }
    lower(&mut draws, 95, 0..60, 200.0);
    let found = Stranded::among(&draws);
    assert_eq!(found.to_the_end, (0..93).collect::<Vec<_>>());
    assert_eq!(found.late, [95]);
}

#[test]
fn acceptance_counts_the_steps_that_moved() {
    let draws = Draws {
        names: vec!["x".into()],
        chains: 2,
        steps: 5,
        values: vec![1.0, 1.0, 2.0, 2.0, 3.0, 4.0, 4.0, 4.0, 4.0, 4.0],
        log_density: vec![0.0; 10],
    };
    assert_eq!(walkers::acceptance(&draws), [0.5, 0.0]);
}

#[test]
fn a_diagnosis_says_what_would_help() {
    let good = Diagnosis::of(&healthy(2, 40, 600, 0.9, 1), true);
    assert!(good.converged, "{:?}", good.advice);
    assert_eq!(good.more_steps, 0);

    let short = Diagnosis::of(&healthy(2, 40, 60, 0.9, 1), true);
    // tau is (1 + 0.9) / (1 - 0.9) = 19 steps, so about 130 more steps are needed.
    assert!(!short.converged && (60..300).contains(&short.more_steps), "{}", short.more_steps);
    assert!(short.advice.iter().any(|a| a.contains("more steps to reach 10 autocorrelation")));

    let mut split = healthy(2, 40, 600, 0.9, 1);
    lower(&mut split, 7, 0..600, 60.0);
    let split = Diagnosis::of(&split, true);
    assert!(!split.converged);
    assert_eq!(
        split.advice[0],
        "1 of 40 walkers never reached the bulk: start them around the best fit"
    );
}

#[test]
fn the_error_of_an_ensemble_mean_is_that_of_its_independent_chains() {
    // For independent chains both errors estimate the same number, sqrt(tau / (chains steps)) = sqrt(19 / 80000) for
    // this law; each has an uncertainty of about 10 %.
    let values: Vec<Vec<f64>> = healthy(1, 20, 4000, 0.9, 2).coordinate(0).collect();
    let exact = (19.0_f64 / 80_000.0).sqrt();
    assert!((autocorrelation::ensemble_error(&values) / exact - 1.0).abs() < 0.25);
    assert!((chains::mcse_mean(&values) / exact - 1.0).abs() < 0.25);
}

#[test]
fn a_note_leaves_the_verdict_and_a_doubt_turns_it() {
    let good = || Diagnosis::of(&healthy(2, 40, 6000, 0.9, 1), true);
    assert!(good().converged);
    let noted = good().with_notes(vec!["a note".into()]);
    assert!(noted.converged && noted.advice == ["a note"]);
    assert!(!noted.with_doubts(vec!["a doubt".into()]).converged);
}

#[test]
fn no_draws_are_no_reason_to_panic() {
    let empty = healthy(2, 3, 0, 0.5, 1);
    let diagnosis = Diagnosis::of(&empty, true);
    assert!(!diagnosis.converged && diagnosis.more_steps > 0);
    assert!(!Diagnosis::of(&healthy(1, 1, 10, 0.5, 1), false).converged);
}
