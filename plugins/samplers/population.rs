//! Populations that start as draws of the prior, and their storage in the state between steps.

use lacuna::math::random::Stream;
use lacuna::plugin::Target;
use lacuna::plugin::sampler::State;
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use lacuna_linalg::Matrix;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::evaluated::Evaluated;

/// Fraction of the prior's mass inside the support of the density, as estimated by the initial draws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Share {
    /// Logarithm of the fraction.
    pub log: f64,
    /// Variance of that logarithm.
    pub variance: f64,
}

impl Share {
    /// Estimates the fraction from the number of draws, `tried`, that gave `count` points inside the support.
    fn of(count: usize, tried: u64) -> Self {
        if tried == count as u64 {
            return Self { log: 0.0, variance: 0.0 };
        }
        // The draws stop at the last point needed, so that their number is negative binomial; this estimator is
        // unbiased for it.
        let share = (count as f64 - 1.0) / (tried as f64 - 1.0);
        Self { log: share.ln(), variance: (1.0 - share) / count as f64 }
    }
}

/// Reports options that are not between 0 and 1.
pub(super) fn check_shares(options: &[(&str, f64)], complaints: &mut Complaints<'_>) {
    for &(name, value) in options {
        if !(value > 0.0 && value < 1.0) {
            let spot = complaints.at(name);
            spot.say("this is out of range").expected("a number between 0 and 1").found(value);
        }
    }
}

/// Reports counts of zero.
pub(super) fn check_counts(options: &[(&str, usize)], complaints: &mut Complaints<'_>) {
    for &(name, value) in options {
        if value == 0 {
            complaints.at(name).say("nothing to do").expected("at least 1").found(0);
        }
    }
}

/// Returns the state before the first step. The population itself is drawn from the prior at the first step; of the
/// starting points only the number counts, so that their density does not matter.
pub(super) fn start(target: &dyn Target, points: Matrix, count: usize) -> Result<State, Stop> {
    let log_density = counted(target, &points, count)?;
    Ok(State {
        points,
        log_density,
        accepted: vec![false; count],
        evaluations: count as u64,
        memory: serde_json::Value::Null,
    })
}

/// Takes the population and the memory out of a state. Before the first step the population is drawn from the prior,
/// and `first` makes the memory.
pub(super) fn resume<M: DeserializeOwned>(
    target: &dyn Target,
    state: &mut State,
    first: impl FnOnce(Share) -> M,
    stream: &Stream,
) -> Result<(Evaluated, M), Stop> {
    if let Some(memory) = recall(state)? {
        return Ok((Evaluated::take(target, state), memory));
    }
    let (drawn, share) = from_prior(target, state.points.rows(), &stream.named("prior"))?;
    Ok((drawn, first(share)))
}

/// Puts a population and its memory back into their state.
pub(super) fn keep<M: Serialize>(
    state: &mut State,
    population: Evaluated,
    memory: &M,
) -> Result<(), Stop> {
    state.evaluations += population.evaluations;
    state.points = population.points;
    state.log_density = population.log_density;
    state.memory = serde_json::to_value(memory).map_err(|e| Stop::new(e.to_string()))?;
    Ok(())
}

/// Reads the memory of a state; `None` before the first step.
pub(super) fn recall<M: DeserializeOwned>(state: &State) -> Result<Option<M>, Stop> {
    Option::deserialize(&state.memory)
        .map_err(|error| Stop::new(format!("the saved state of the sampler is damaged: {error}")))
}

/// Reads the memory of a state at harvest; fails before the first step.
pub(super) fn remembered<M: DeserializeOwned>(state: &State) -> Result<M, Stop> {
    recall(state)?.ok_or_else(|| Stop::new("there are no draws: the sampler has not made a step"))
}

/// Returns the log densities of the starting points, one per chain; fails if their number or dimension is wrong.
fn counted(target: &dyn Target, points: &Matrix, chains: usize) -> Result<Vec<f64>, Stop> {
    let dimension = target.dimension();
    if (points.rows(), points.columns()) != (chains, dimension) {
        return Err(Stop::new(format!(
            "expected a starting point of {dimension} coordinates for each of {chains} chains, \
             found {} points of {}",
            points.rows(),
            points.columns()
        )));
    }
    Ok(target.log_density(points))
}

/// Draws `count` points from the prior, all of them inside the support of the density, and estimates the fraction of
/// the prior inside it.
fn from_prior(
    target: &dyn Target,
    count: usize,
    stream: &Stream,
) -> Result<(Evaluated, Share), Stop> {
    const ROUNDS: u64 = 1000;
    let mut kept = Evaluated {
        points: Matrix::zeros(0, target.dimension()),
        log_prior: Vec::new(),
        log_density: Vec::new(),
        evaluations: 0,
    };
    for round in 0..ROUNDS {
        let drawn = Evaluated::new(target, target.prior_draws(count, &stream.at(round)));
        kept.evaluations += drawn.evaluations;
        for i in 0..count {
            if !drawn.log_likelihood(i).is_finite() {
                continue;
            }
            kept.points.push_row(drawn.points.row(i));
            kept.log_prior.push(drawn.log_prior[i]);
            kept.log_density.push(drawn.log_density[i]);
            if kept.points.rows() == count {
                return Ok((kept, Share::of(count, round * count as u64 + i as u64 + 1)));
            }
        }
    }
    Err(Stop::new(format!(
        "of {} draws of the prior only {} have a posterior density above zero",
        ROUNDS * count as u64,
        kept.points.rows()
    ))
    .help("narrow the priors to where the model and its surrogate have values"))
}
