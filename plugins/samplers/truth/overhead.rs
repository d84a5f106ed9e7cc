//! Measurements, not tests: the samplers' own time on a density that costs next to nothing.

use std::fs;

use super::super::adaptive_metropolis::AdaptiveMetropolis;
use super::super::affine_invariant_ensemble::{AffineInvariantEnsemble, Moves, Update};
use super::super::delayed_rejection_adaptive_metropolis::DelayedRejectionAdaptiveMetropolis;
use super::super::differential_evolution::DifferentialEvolution;
use super::super::metropolis::Metropolis;
use super::*;

/// Nanoseconds for which this thread has run, as Linux counts them: other programs do not count.
fn now() -> f64 {
    let text = fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    text.split(' ').next().unwrap().parse().unwrap()
}

fn measure(name: &str, sampler: &dyn Sampler, steps: u64) {
    let priors = vec![Distribution::Normal([0.0, 1.0]); 4];
    let target = Density::new(priors, |x: &[f64]| -0.5 * x.iter().map(|x| x * x).sum::<f64>());
    let root = Stream::root(1);
    let plan = sampler.plan(4);
    let mut state = sampler.start(&target, target.prior_draws(plan.chains, &root)).unwrap();
    let mut each = Vec::new();
    for part in 0..2 {
        let (begin, before) = (now(), state.evaluations);
        for step in part * steps..(part + 1) * steps {
            sampler.step(&target, &mut state, &root.at(step)).unwrap();
        }
        each.push((now() - begin) / (state.evaluations - before) as f64);
    }
    println!("{name}: {:.0} and {:.0} ns an evaluation", each[0], each[1]);
}

#[test]
#[ignore = "a measurement"]
fn overhead_of_a_move() {
    let none = Moves { stretch: 0.0, ..Moves::default() };
    for (name, moves, update) in [
        ("stretch, split", Moves::default(), Update::Split),
        ("stretch, sequential", Moves::default(), Update::Sequential),
        ("walk, split", Moves { walk: 1.0, ..none.clone() }, Update::Split),
        (
            "differential evolution, split",
            Moves { differential_evolution: 1.0, ..none.clone() },
            Update::Split,
        ),
        ("snooker, split", Moves { snooker: 1.0, ..none.clone() }, Update::Split),
    ] {
        let sampler = AffineInvariantEnsemble { moves, update, ..Default::default() };
        measure(name, &sampler, 6000);
    }
    let warm_up = 100_000;
    measure("metropolis", &Metropolis::default(), warm_up);
    measure("adaptive", &AdaptiveMetropolis { warm_up: 100_000, ..Default::default() }, 100_000);
    measure(
        "delayed rejection",
        &DelayedRejectionAdaptiveMetropolis { warm_up: 100_000, ..Default::default() },
        100_000,
    );
    measure("evolution", &DifferentialEvolution::default(), 100_000);
}
