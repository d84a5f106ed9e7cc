//! The random walks, differential evolution and each move of the ensemble on densities with known moments.

use lacuna::math::moments::Moments;
use lacuna::plugin::sampler::Plan;
use lacuna_linalg::{Cholesky, Matrix};
use rayon::prelude::*;

use super::super::adaptation::Adapt;
use super::super::adaptive_metropolis::AdaptiveMetropolis;
use super::super::affine_invariant_ensemble::{AffineInvariantEnsemble, Moves, Update};
use super::super::delayed_rejection_adaptive_metropolis::DelayedRejectionAdaptiveMetropolis;
use super::super::differential_evolution::DifferentialEvolution;
use super::super::metropolis::Metropolis;
use super::super::proposal::Proposal;
use super::*;

type Named = (&'static str, Box<dyn Sampler>);

/// The samplers with independent chains.
fn walks(steps: usize, warm_up: usize) -> Vec<Named> {
    vec![
        ("metropolis", Box::new(Metropolis { steps, ..Default::default() })),
        ("adaptive", Box::new(AdaptiveMetropolis { steps, warm_up, ..Default::default() })),
        (
            "delayed rejection",
            Box::new(DelayedRejectionAdaptiveMetropolis { steps, warm_up, ..Default::default() }),
        ),
        ("evolution", Box::new(DifferentialEvolution { steps, warm_up, ..Default::default() })),
    ]
}

/// The ensemble with each move alone, in both orders of update.
fn moves(walkers: usize, steps: usize) -> Vec<Named> {
    let none = Moves { stretch: 0.0, ..Moves::default() };
    let all = [
        ("stretch", Moves::default()),
        ("walk", Moves { walk: 1.0, ..none.clone() }),
        ("jump", Moves { differential_evolution: 1.0, ..none.clone() }),
        ("snooker", Moves { snooker: 1.0, ..none.clone() }),
        ("mixed", Moves { stretch: 0.5, walk: 0.2, differential_evolution: 0.2, snooker: 0.1 }),
    ];
    let orders = [Update::Split, Update::Sequential];
    all.into_iter()
        .flat_map(|pair| orders.map(|update| (pair.clone(), update)))
        .map(|((name, moves), update)| {
            let rest = AffineInvariantEnsemble::default();
            let sampler = AffineInvariantEnsemble { walkers, steps, moves, update, ..rest };
            (name, Box::new(sampler) as Box<dyn Sampler>)
        })
        .collect()
}

/// A check: the name of a mean, its value, the largest allowed error, and the function of the unknowns.
type Mean = (&'static str, f64, f64, fn(&[f64]) -> f64);

fn judge(samplers: &[Named], target: &dyn Target, means: &[Mean]) {
    samplers.par_iter().for_each(|(name, sampler)| {
        let Plan { ensemble, .. } = sampler.plan(target.dimension());
        let draws = run(&**sampler, target, 3);
        for (what, expected, largest, f) in means {
            let label = format!("{name}, {what}");
            assert_mean((&label, &draws, ensemble), *expected, *largest, f);
        }
    });
}

const SCALE: [f64; 5] = [1e-3, 1.0, 1e3, 5.0, 1e-1];

/// A normal density with the correlations `0.9^|i - j|` and means equal to the scales.
fn correlated(dimension: usize) -> Density<impl Fn(&[f64]) -> f64 + Sync> {
    let entry = |i: usize, j: usize| 0.9_f64.powi(i.abs_diff(j) as i32);
    let factor = Cholesky::new(&Matrix::from_fn(dimension, dimension, entry)).unwrap();
    let priors = (0..dimension).map(|j| Distribution::Normal([SCALE[j], 3.0 * SCALE[j]])).collect();
    Density::new(priors, move |x: &[f64]| {
        let u: Vec<f64> = x.iter().zip(SCALE).map(|(x, s)| x / s - 1.0).collect();
        -0.5 * factor.quadratic(&u)
    })
}

#[test]
fn contracts_hold() {
    let adapt = Adapt::Always;
    let proposal = Proposal::Prior(0.3);
    let mut samplers = walks(3000, 1000);
    samplers.extend(moves(40, 2000));
    samplers.push((
        "adaptive for ever",
        Box::new(AdaptiveMetropolis { adapt, proposal, ..Default::default() }),
    ));
    samplers
        .push(("metropolis of the prior", Box::new(Metropolis { proposal, ..Default::default() })));
    samplers.push((
        "evolution from the prior",
        Box::new(DifferentialEvolution { archive: Proposal::Prior(1.0), ..Default::default() }),
    ));
    let breaches: Vec<String> = samplers
        .par_iter()
        .flat_map_iter(|(name, s)| lacuna_contract::sampler(name, &**s).err().unwrap_or_default())
        .collect();
    assert!(breaches.is_empty(), "{}", breaches.join("\n"));
}

#[test]
fn a_conjugate_normal_posterior_is_found() {
    // Source: the self-test of UQLab. Prior N(7, variance 2), data 9.1241 and 8.151 with variance 3; the
    // posterior is normal with precision 1/2 + 2/3 = 7/6, variance 0.857143 and mean 7.935743.
    let priors = vec![Distribution::Normal([7.0, 2.0_f64.sqrt()])];
    let target = Density::new(priors, |x: &[f64]| {
        let misfit = (9.1241 - x[0]).powi(2) + (8.151 - x[0]).powi(2);
        -0.25 * (x[0] - 7.0).powi(2) - misfit / 6.0
    });
    for (name, sampler) in walks(1500, 500).into_iter().chain(moves(100, 60)) {
        let mut divergences: Vec<f64> = (0..20)
            .map(|seed| {
                let moments = Moments::of_rows(&run(&*sampler, &target, seed).points());
                let (mean, variance) = (moments.mean()[0], moments.covariance()[(0, 0)]);
                let ratio = variance / 0.857_143;
                0.5 * (ratio - 1.0 - ratio.ln() + (mean - 7.935_743_f64).powi(2) / 0.857_143)
            })
            .collect();
        divergences.sort_by(f64::total_cmp);
        println!("{name}: median divergence {:.5}", divergences[10]);
        assert!(divergences[10] < 0.01, "{name}: {divergences:?}");
    }
}

#[test]
fn a_correlated_normal_law_has_its_moments() {
    let means: [Mean; 6] = [
        ("mean of the first", 1.0, 0.1, |x| x[0] / SCALE[0]),
        ("mean of the third", 1.0, 0.1, |x| x[2] / SCALE[2]),
        ("variance of the first", 1.0, 0.15, |x| (x[0] / SCALE[0] - 1.0).powi(2)),
        ("variance of the last", 1.0, 0.15, |x| (x[4] / SCALE[4] - 1.0).powi(2)),
        ("covariance of neighbours", 0.9, 0.15, |x| {
            (x[0] / SCALE[0] - 1.0) * (x[1] / SCALE[1] - 1.0)
        }),
        ("covariance of the ends", 0.6561, 0.15, |x| {
            (x[0] / SCALE[0] - 1.0) * (x[4] / SCALE[4] - 1.0)
        }),
    ];
    judge(&walks(12_000, 2000), &correlated(5), &means);
}

#[test]
fn a_twisted_normal_law_has_its_moments() {
    // Source: Haario, Saksman and Tamminen, Computational Statistics 14 (1999) 375, pi_3: x1 with variance 100, x2 +
    // b x1^2 - 100 b standard normal, b = 0.03, and two further standard normal coordinates. The moments of the
    // normal distribution give E x2 = 0 and var x2 = 1 + 2 b^2 100^2 = 19.
    let target = Density::new(vec![Distribution::Normal([0.0, 10.0]); 4], |x: &[f64]| {
        let bent = x[1] + 0.03 * x[0] * x[0] - 3.0;
        -0.5 * (x[0] * x[0] / 100.0 + bent * bent + x[2] * x[2] + x[3] * x[3])
    });
    let means: [Mean; 5] = [
        ("mean of x1", 0.0, 1.5, |x| x[0]),
        ("variance of x1", 100.0, 20.0, |x| x[0] * x[0]),
        ("mean of x2", 0.0, 0.5, |x| x[1]),
        ("variance of x2", 19.0, 6.0, |x| x[1] * x[1]),
        ("variance of x3", 1.0, 0.1, |x| x[2] * x[2]),
    ];
    judge(&walks(50_000, 5000), &target, &means);
}

/// The product of an exponential density with mean 1, a uniform one, and a beta density with shapes 2 and 5.
fn bounded() -> Density<impl Fn(&[f64]) -> f64 + Sync> {
    let inside =
        |x: &[f64]| x[0] >= 0.0 && (0.0..=1.0).contains(&x[1]) && (0.0..=1.0).contains(&x[2]);
    Density {
        priors: vec![
            Distribution::Exponential(2.0),
            Distribution::Uniform([0.0, 1.0]),
            Distribution::Uniform([0.0, 1.0]),
        ],
        bounds: vec![(0.0, f64::INFINITY), (0.0, 1.0), (0.0, 1.0)],
        function: move |x: &[f64]| {
            if inside(x) { -x[0] + x[2].ln() + 4.0 * (-x[2]).ln_1p() } else { f64::NEG_INFINITY }
        },
    }
}

#[test]
fn bounded_laws_have_their_moments() {
    let means: [Mean; 6] = [
        ("exponential mean", 1.0, 0.05, |x| x[0]),
        ("exponential variance", 1.0, 0.15, |x| (x[0] - 1.0).powi(2)),
        ("uniform mean", 0.5, 0.03, |x| x[1]),
        ("uniform variance", 1.0 / 12.0, 0.01, |x| (x[1] - 0.5).powi(2)),
        ("beta mean", 2.0 / 7.0, 0.02, |x| x[2]),
        ("beta variance", 10.0 / (49.0 * 8.0), 0.005, |x| (x[2] - 2.0 / 7.0).powi(2)),
    ];
    judge(&walks(20_000, 2000), &bounded(), &means);
    judge(&moves(40, 6000), &bounded(), &means);
}

#[test]
fn each_move_of_the_ensemble_keeps_a_correlated_normal_law() {
    let means: [Mean; 6] = [
        ("mean of the first", 1.0, 0.05, |x| x[0] / SCALE[0]),
        ("mean of the third", 1.0, 0.05, |x| x[2] / SCALE[2]),
        ("variance of the first", 1.0, 0.1, |x| (x[0] / SCALE[0] - 1.0).powi(2)),
        ("variance of the third", 1.0, 0.1, |x| (x[2] / SCALE[2] - 1.0).powi(2)),
        ("covariance", 0.81, 0.1, |x| (x[0] / SCALE[0] - 1.0) * (x[2] / SCALE[2] - 1.0)),
        ("fourth moment", 3.0, 0.5, |x| (x[1] / SCALE[1] - 1.0).powi(4)),
    ];
    judge(&moves(30, 8000), &correlated(3), &means);
}

#[test]
fn walks_and_moves_keep_a_skewed_law() {
    // x ~ gamma(3), y | x ~ N(x, 1), z | y ~ N(y^2 / 16, 1): the moments of the gamma distribution about zero are 3,
    // 12, 60, 360, so that E y^2 = 13, E z = 13/16, var x = 3, var y = 4, and E (x - 3)^3 = 6.
    let target = Density {
        priors: vec![
            Distribution::Gamma([3.0, 1.0]),
            Distribution::Normal([3.0, 2.0]),
            Distribution::Normal([3.0, 3.0]),
        ],
        bounds: vec![(0.0, f64::INFINITY), (f64::NEG_INFINITY, f64::INFINITY), (-1e3, 1e3)],
        function: |x: &[f64]| {
            if x[0] <= 0.0 {
                return f64::NEG_INFINITY;
            }
            let (y, z) = (x[1] - x[0], x[2] - x[1] * x[1] / 16.0);
            2.0 * x[0].ln() - x[0] - 0.5 * (y * y + z * z)
        },
    };
    let means: [Mean; 6] = [
        ("mean of x", 3.0, 0.1, |x| x[0]),
        ("variance of x", 3.0, 0.3, |x| (x[0] - 3.0).powi(2)),
        ("third moment of x", 6.0, 3.0, |x| (x[0] - 3.0).powi(3)),
        ("variance of y", 4.0, 0.4, |x| (x[1] - 3.0).powi(2)),
        ("mean of z", 13.0 / 16.0, 0.1, |x| x[2]),
        ("residual of z", 1.0, 0.1, |x| (x[2] - x[1] * x[1] / 16.0).powi(2)),
    ];
    judge(&moves(30, 20_000), &target, &means);
    judge(&walks(50_000, 5000), &target, &means);
}

#[test]
fn jumps_find_their_way_between_two_modes() {
    // Two normal densities of unit variance at (-5, -5) and (5, 5), the second with twice the weight.
    let target = Density::new(vec![Distribution::Normal([0.0, 6.0]); 2], |x: &[f64]| {
        let near = |m: f64| -0.5 * ((x[0] - m).powi(2) + (x[1] - m).powi(2));
        let (a, b) = (near(-5.0), near(5.0) + 2.0_f64.ln());
        let most = a.max(b);
        most + ((a - most).exp() + (b - most).exp()).ln()
    });
    let moves = Moves { stretch: 0.0, differential_evolution: 0.8, snooker: 0.2, walk: 0.0 };
    let rest = AffineInvariantEnsemble::default();
    let samplers: Vec<Named> = vec![
        (
            "evolution",
            Box::new(DifferentialEvolution {
                steps: 40_000,
                archive: Proposal::Prior(1.0),
                ..Default::default()
            }),
        ),
        ("ensemble", Box::new(AffineInvariantEnsemble { walkers: 60, steps: 5000, moves, ..rest })),
    ];
    let means: [Mean; 2] = [
        ("weight of the second mode", 2.0 / 3.0, 0.03, |x| f64::from(u8::from(x[0] > 0.0))),
        ("variance in the second mode", 2.0 / 3.0, 0.05, |x| {
            if x[0] > 0.0 { (x[1] - 5.0).powi(2) } else { 0.0 }
        }),
    ];
    judge(&samplers, &target, &means);
}
