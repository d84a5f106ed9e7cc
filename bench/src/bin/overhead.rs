//! Time per evaluation spent in the samplers themselves, on a density of four unknowns with negligible cost.
//!
//! Two values each: for the first half of the steps, including the warm-up, and for the second half.

use std::error::Error;

use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::{Sampler, Target};
use lacuna_bench::clock::timed;
use lacuna_linalg::Matrix;
use lacuna_plugins::samplers::adaptive_metropolis::AdaptiveMetropolis;
use lacuna_plugins::samplers::affine_invariant_ensemble::{AffineInvariantEnsemble, Moves, Update};
use lacuna_plugins::samplers::delayed_rejection_adaptive_metropolis::DelayedRejectionAdaptiveMetropolis;
use lacuna_plugins::samplers::differential_evolution::DifferentialEvolution;
use lacuna_plugins::samplers::metropolis::Metropolis;

const UNKNOWNS: usize = 4;
const PRIOR: Distribution = Distribution::Normal([0.0, 1.0]);

/// Independent standard normal variables.
struct Standard;

impl Target for Standard {
    fn dimension(&self) -> usize {
        UNKNOWNS
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|x| -0.5 * x.iter().map(|x| x * x).sum::<f64>()).collect()
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|x| x.iter().map(|&x| PRIOR.log_density(x)).sum()).collect()
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let square: f64 = point.iter().map(|x| x * x).sum();
        (-0.5 * square, point.iter().map(|x| -x).collect())
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        vec![(f64::NEG_INFINITY, f64::INFINITY); UNKNOWNS]
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        Matrix::from_fn(count, UNKNOWNS, |_, _| PRIOR.sample(&mut rng))
    }
}

fn measure(name: &str, sampler: &dyn Sampler, steps: u64) -> Result<(), Box<dyn Error>> {
    let root = Stream::root(1);
    let chains = sampler.plan(UNKNOWNS).chains;
    let mut state = sampler.start(&Standard, Standard.prior_draws(chains, &root))?;
    let mut each = Vec::new();
    for part in 0..2 {
        let before = state.evaluations;
        let range = part * steps..(part + 1) * steps;
        let mut walk = || {
            range.clone().try_for_each(|step| sampler.step(&Standard, &mut state, &root.at(step)))
        };
        let (done, seconds) = timed(&mut walk)?;
        done?;
        each.push(1e9 * seconds / (state.evaluations - before) as f64);
    }
    println!("{name}: {:.0} and {:.0} ns an evaluation", each[0], each[1]);
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let none = Moves { stretch: 0.0, ..Moves::default() };
    let evolution = Moves { differential_evolution: 1.0, ..none.clone() };
    for (name, moves, update) in [
        ("stretch, split", Moves::default(), Update::Split),
        ("stretch, sequential", Moves::default(), Update::Sequential),
        ("walk, split", Moves { walk: 1.0, ..none.clone() }, Update::Split),
        ("differential evolution, split", evolution, Update::Split),
        ("snooker, split", Moves { snooker: 1.0, ..none }, Update::Split),
    ] {
        measure(name, &AffineInvariantEnsemble { moves, update, ..Default::default() }, 6000)?;
    }
    let (steps, warm_up) = (100_000, 100_000);
    measure("metropolis", &Metropolis::default(), steps)?;
    measure("adaptive", &AdaptiveMetropolis { warm_up, ..Default::default() }, steps)?;
    let delayed = DelayedRejectionAdaptiveMetropolis { warm_up, ..Default::default() };
    measure("delayed rejection", &delayed, steps)?;
    measure("evolution", &DifferentialEvolution::default(), steps)
}
