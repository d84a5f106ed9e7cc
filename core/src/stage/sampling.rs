//! A sampler's steps with checkpoints: a killed run goes on with the same bits.
//!
//! The random numbers of a step depend on its number alone, and whether a run goes on is decided after numbers of
//! steps that depend on the draws alone.

mod log;

use std::path::Path;
use std::time::{Duration, Instant};

use crate::data::{Draws, Statistics};
use crate::diagnose::chains;
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::plugin::sampler::{Harvest, Plan, State};
use crate::plugin::{Sampler, Target};
use crate::run::{Progress, Stop};
use crate::study::file::StopRule;
use crate::study::values::Count;

use log::{Log, Read};

/// All draws of a run with what became of each step.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampled {
    /// The draws, in the target's coordinates.
    pub draws: Draws,
    /// The share of accepted moves of each chain; empty where the draws are those of a harvest.
    pub acceptance: Vec<f64>,
    /// What the sampler told of each step; nothing where the draws are those of a harvest.
    pub statistics: Statistics,
    /// The number of first steps that are left out.
    pub burn_in: usize,
    /// What the method brings home, if its steps are no draws; then `draws` are made of it.
    pub harvest: Option<Harvest>,
    /// The last state.
    pub state: State,
}

/// How long to sample.
#[derive(Debug, Clone, Copy)]
pub struct Length<'a> {
    /// The share of the first steps that is left out.
    pub burn_in: f64,
    /// What must be reached.
    pub stop: Option<&'a StopRule>,
    /// Whether half of the planned steps after the warm-up are enough, where the steps are draws; then nothing must be
    /// reached.
    pub half: bool,
}

/// How soon the state is written first; each further time takes twice as long, up to [`INTERVAL`].
const FIRST: Duration = Duration::from_millis(100);
/// How often the state is written in a long run.
const INTERVAL: Duration = Duration::from_secs(2);
/// How many times the sampler's own number of steps a run may have to reach its stop rule.
const PATIENCE: usize = 50;
/// The number of chains into which independent draws are dealt.
const HANDS: usize = 4;

/// Stops when the target can no longer be computed; a step made of such values is not kept.
pub(super) fn broken(target: &dyn Target) -> Result<(), Stop> {
    target.failure().map_or(Ok(()), |reason| Err(Stop::new(reason)))
}

/// Runs a sampler, going on from a checkpoint in `folder` if there is one.
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
            sampler.step(target, &mut state, &stream.at(step as u64))?;
            broken(target)?;
            log.append(&state, &sampler.statistics(&state))?;
            step += 1;
            progress.add(1);
            if written.elapsed() > interval {
                log.checkpoint(step, &state)?;
                (written, interval) = (Instant::now(), INTERVAL.min(2 * interval));
            }
        }
        log.checkpoint(step, &state)?;
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
            // The moves are those of particles, which the chains of the draws are not.
            let (acceptance, statistics) = (Vec::new(), Statistics::default());
            Sampled { draws, acceptance, statistics, burn_in: 0, harvest: Some(harvest), state }
        }
        None => Sampled { draws, acceptance, statistics, burn_in, harvest: None, state },
    })
}

/// The steps of a plan that can be draws.
fn draws_of(plan: Plan) -> usize {
    plan.steps.saturating_sub(plan.warm_up)
}

/// The steps that are left out of this many.
fn burn_in(plan: Plan, share: f64, steps: usize) -> usize {
    ((share * steps as f64).floor() as usize).max(plan.warm_up).min(steps)
}

/// After how many steps to look again; `None` when there are enough draws, or steps.
fn next_limit(draws: &Draws, plan: Plan, share: f64, rule: &StopRule) -> Option<usize> {
    let steps = draws.steps;
    let most = rule.max_steps.map_or(PATIENCE * plan.steps, Count::get);
    let wanted = rule.effective_sample_size.get() as f64;
    let size = smallest_size(&draws.from_step(burn_in(plan, share, steps)));
    if steps >= most || size >= wanted {
        return None;
    }
    // A tenth more than the present rate asks for, and never more than as many steps again.
    let needed = 1.1 * steps as f64 * wanted / size;
    let next = if needed.is_finite() { (needed as usize).min(2 * steps) } else { 2 * steps };
    Some(next.max(steps + steps.div_ceil(10)).min(most))
}

/// The smallest effective sample size of bulk and tails.
fn smallest_size(draws: &Draws) -> f64 {
    let of = |j: usize| {
        let values: Vec<Vec<f64>> = draws.coordinate(j).collect();
        let (bulk, tail) = (chains::ess_bulk(&values), chains::ess_tail(&values));
        // A size that has no value is none.
        if bulk.is_nan() || tail.is_nan() { 0.0 } else { bulk.min(tail) }
    };
    (0..draws.dimension()).map(of).fold(f64::INFINITY, f64::min)
}

/// Independent draws dealt into chains, so that they are summed up and drawn like all others.
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
