//! Populations that begin with draws of the prior, and what is kept of them from step to step.

use lacuna::linalg::Matrix;
use lacuna::math::random::Stream;
use lacuna::plugin::Target;
use lacuna::plugin::sampler::State;
use lacuna::run::Stop;
use lacuna::study::problem::Complaints;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::evaluated::Evaluated;

/// The share of the prior that lies inside the support of the density.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Share {
    /// Its logarithm.
    pub log: f64,
    /// The variance of that.
    pub variance: f64,
}

impl Share {
    /// The share when it took so many tries to draw so many points inside.
    fn of(count: usize, tried: u64) -> Self {
        if tried == count as u64 {
            return Self { log: 0.0, variance: 0.0 };
        }
        // The draws stop at the last point that is needed: a negative binomial number of them.
        let share = (count as f64 - 1.0) / (tried as f64 - 1.0);
        Self { log: share.ln(), variance: (1.0 - share) / count as f64 }
    }
}

/// Complains about options that are no share between 0 and 1.
pub(super) fn check_shares(options: &[(&str, f64)], complaints: &mut Complaints<'_>) {
    for &(name, value) in options {
        if !(value > 0.0 && value < 1.0) {
            let spot = complaints.at(name);
            spot.say("not a share").expected("a number between 0 and 1").found(value);
        }
    }
}

/// Complains about options that leave nothing to do.
pub(super) fn check_counts(options: &[(&str, usize)], complaints: &mut Complaints<'_>) {
    for &(name, value) in options {
        if value == 0 {
            complaints.at(name).say("nothing to do").expected("at least 1").found(0);
        }
    }
}

/// The state before the first step, which draws from the prior: the starting points are counted and used for nothing
/// else, so that their density does not matter.
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

/// The population of a state, which loses it, and its memory; before the first step draws of the prior, and the
/// memory that begins with them.
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

/// Gives a population and its memory back to their state.
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

/// The memory of a state; none before the first step.
pub(super) fn recall<M: DeserializeOwned>(state: &State) -> Result<Option<M>, Stop> {
    Option::deserialize(&state.memory)
        .map_err(|error| Stop::new(format!("the saved state of the sampler is damaged: {error}")))
}

/// The memory of a state from which draws are to be harvested.
pub(super) fn remembered<M: DeserializeOwned>(state: &State) -> Result<M, Stop> {
    recall(state)?.ok_or_else(|| {
        Stop::new("the points have not left their starting places, which are no draws")
    })
}

/// The log densities of one starting point a chain.
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

/// Draws of the prior, all of them inside the support of the density, and the support's share of the prior.
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
