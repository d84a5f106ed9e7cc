//! Steps of a sampler with checkpoints: a killed run continues with the same bits.
//!
//! The random numbers of a step depend on its index alone, and the decision to stop is taken after numbers of steps
//! that depend on the draws alone.

mod log;
pub mod look;

use std::path::Path;
use std::time::{Duration, Instant};

use lacuna::data::{Draws, Statistics};
use lacuna::diagnose::chains;
use lacuna::math::random::Stream;
use lacuna::plugin::sampler::{Harvest, Plan, State};
use lacuna::plugin::{Sampler, Target};
use lacuna::run::{Progress, Stop};
use lacuna::text::values::Count;
use lacuna_linalg::Matrix;

use crate::study::file::StopRule;
use log::{Log, Read};

/// All draws of a run, with statistics of each step.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampled {
    /// Draws in the target's coordinates.
    pub draws: Draws,
    /// Acceptance rate of each chain; empty if the draws are those of a harvest.
    pub acceptance: Vec<f64>,
    /// Statistics that the sampler reported for each step; empty if the draws are those of a harvest.
    pub statistics: Statistics,
    /// Number of initial steps that are dropped.
    pub burn_in: usize,
    /// Harvest of a method whose steps are not draws; `draws` are made from it.
    pub harvest: Option<Harvest>,
    /// Last state.
    pub state: State,
}

/// Length of a run.
#[derive(Debug, Clone, Copy)]
pub struct Length<'a> {
    /// Fraction of the initial steps that is dropped.
    pub burn_in: f64,
    /// Stopping rule.
    pub stop: Option<&'a StopRule>,
    /// True if half of the planned steps after the warm-up suffice, for samplers whose steps are draws; the stopping
    /// rule is then ignored.
    pub half: bool,
}

/// Time until the state is written first; each further interval is twice as long, up to [`INTERVAL`].
const FIRST: Duration = Duration::from_millis(100);
/// Interval between writes of the state in a long run.
const INTERVAL: Duration = Duration::from_secs(2);
/// Largest length of a run with a stopping rule, in multiples of the sampler's own number of steps.
const PATIENCE: usize = 50;
/// Number of chains over which independent draws are distributed.
const HANDS: usize = 4;

/// Returns an error if the target can no longer be computed; a step computed from such values is not kept.
pub(super) fn broken(target: &dyn Target) -> Result<(), Stop> {
    target.failure().map_or(Ok(()), |reason| Err(Stop::new(reason)))
}

/// Runs a sampler, continuing from a checkpoint in `folder` if there is one.
pub fn sample(
    sampler: &dyn Sampler,
    target: &dyn Target,
    length: Length<'_>,
    start: impl FnOnce() -> Result<Matrix, Stop>,
    stream: &Stream,
    folder: &Path,
    progress: &Progress<'_>,
) -> Result<Sampled, Stop> {
    let plan = sampler.plan(target.dimension());
    let mut log = Log::open(folder, plan.chains, target.dimension())?;
    let checkpoint = log.resume(|state| sampler.statistics(state))?;
    let (mut step, mut state) = if let Some(checkpoint) = checkpoint {
        (checkpoint.step, checkpoint.state)
    } else {
        let state = sampler.start(target, start()?)?;
        log.begin(&sampler.statistics(&state));
        (0, state)
    };
    progress.add(step as u64);
    let (mut written, mut interval) = (Instant::now(), FIRST);
    let half = length.half && sampler.steps_are_draws();
    let mut limit = if half { plan.steps - draws_of(plan) / 2 } else { plan.steps };
    let rule = length.stop.filter(|_| !half);
    loop {
        while step < limit && !sampler.finished(&state) {
            // The stream belongs to the number of the step, so that a resumed run uses the same numbers.
            sampler.step(target, &mut state, &stream.at(step as u64))?;
            broken(target)?;
            log.append(&state, &sampler.statistics(&state))?;
            step += 1;
            progress.add(1);
            if written.elapsed() > interval {
                log.checkpoint(step, limit, &state)?;
                // Short runs are checkpointed early; in long runs writing takes a negligible part of the time.
                (written, interval) = (Instant::now(), INTERVAL.min(2 * interval));
            }
        }
        log.checkpoint(step, limit, &state)?;
        match rule {
            Some(rule) if !sampler.finished(&state) => {
                let read = log.read(limit)?;
                match next_limit(&read.draws, plan, length.burn_in, rule) {
                    Some(next) => limit = next,
                    None => break,
                }
            }
            _ => break,
        }
    }
    let Read { draws, acceptance, statistics } = log.read(step)?;
    let burn_in = burn_in(plan, length.burn_in, step);
    let harvest = sampler.harvest(target, &state, &stream.named("harvest"))?;
    Ok(match harvest {
        Some(harvest) => {
            let draws = dealt(&harvest);
            // The moves are those of particles, to which the chains of the draws do not correspond.
            let (acceptance, statistics) = (Vec::new(), Statistics::default());
            Sampled { draws, acceptance, statistics, burn_in: 0, harvest: Some(harvest), state }
        }
        None => Sampled { draws, acceptance, statistics, burn_in, harvest: None, state },
    })
}

/// Number of steps of a plan that can be draws.
fn draws_of(plan: Plan) -> usize {
    plan.steps.saturating_sub(plan.warm_up)
}

/// Number of steps dropped out of `steps`.
fn burn_in(plan: Plan, share: f64, steps: usize) -> usize {
    ((share * steps as f64).floor() as usize).max(plan.warm_up).min(steps)
}

/// Number of steps after which to check again; `None` if there are enough draws, or steps.
fn next_limit(draws: &Draws, plan: Plan, share: f64, rule: &StopRule) -> Option<usize> {
    let steps = draws.steps;
    let most = rule.max_steps.map_or(PATIENCE * plan.steps, Count::get);
    let wanted = rule.effective_sample_size.get() as f64;
    let size = smallest_size(&draws.from_step(burn_in(plan, share, steps)));
    if steps >= most || size >= wanted {
        return None;
    }
    // Ten per cent more than the present rate requires, but at most twice the present number of steps.
    let needed = 1.1 * steps as f64 * wanted / size;
    let next = if needed.is_finite() { (needed as usize).min(2 * steps) } else { 2 * steps };
    Some(next.max(steps + steps.div_ceil(10)).min(most))
}

/// Smallest effective sample size of bulk and tails over all coordinates.
fn smallest_size(draws: &Draws) -> f64 {
    let of = |j: usize| {
        let values: Vec<Vec<f64>> = draws.coordinate(j).collect();
        let (bulk, tail) = (chains::ess_bulk(&values), chains::ess_tail(&values));
        // A size that could not be computed counts as zero.
        if bulk.is_nan() || tail.is_nan() { 0.0 } else { bulk.min(tail) }
    };
    (0..draws.dimension()).map(of).fold(f64::INFINITY, f64::min)
}

/// Independent draws distributed over chains, so that they are summarised and plotted like all others.
fn dealt(harvest: &Harvest) -> Draws {
    let steps = harvest.points.rows() / HANDS;
    let (count, d) = (HANDS * steps, harvest.points.columns());
    Draws {
        names: vec![String::new(); d],
        chains: HANDS,
        steps,
        values: harvest.points.as_slice()[..count * d].to_vec(),
        log_density: harvest.log_density[..count].to_vec(),
    }
}
