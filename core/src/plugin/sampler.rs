//! Samplers: draws from a log density.

use serde::{Deserialize, Serialize};

use super::{Component, Fact};
use crate::data::Statistic;
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::run::Stop;
use crate::study::file::Start;

/// A log density to draw from.
///
/// Coordinates are those of the posterior: parameters in physical units, hyperparameters that are
/// declared so in logarithms.
pub trait Target: Sync {
    /// The number of coordinates.
    fn dimension(&self) -> usize;

    /// The log density at each row of `points`; minus infinity outside the support, never NaN.
    fn log_density(&self, points: &Matrix) -> Vec<f64>;

    /// The log prior density at each row of `points`, in the same coordinates; minus infinity outside its
    /// support. The log density less this is the log-likelihood.
    fn log_prior(&self, points: &Matrix) -> Vec<f64>;

    /// The log density at a point and its gradient.
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>);

    /// The closed interval of each coordinate (infinite where it has no bound).
    fn bounds(&self) -> Vec<(f64, f64)>;

    /// Independent draws from the prior, one a row.
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix;

    /// Why the density can no longer be computed, once that has happened: its values mean nothing then.
    fn failure(&self) -> Option<String> {
        None
    }
}

/// Draws from a log density step by step.
pub trait Sampler: Component {
    /// How many chains (walkers) and steps a run has on a density of this dimension.
    fn plan(&self, dimension: usize) -> Plan;

    /// Whether the chains begin at the starting points that they are given. A method that draws its own from the prior
    /// says no: it is then given draws of the prior, whatever their density, and no search for a start can stop it.
    fn uses_starts(&self) -> bool {
        true
    }

    /// Where the chains start when the study does not say.
    fn start_where(&self) -> Start {
        Start::Map
    }

    /// The state before the first step, from one starting point a chain.
    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop>;

    /// One step of all chains. `stream` belongs to this step alone.
    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop>;

    /// Whether this state is the last one, however many steps the plan has.
    fn finished(&self, _state: &State) -> bool {
        false
    }

    /// Whether the points of each step are draws, so that a run may end after any number of steps past the warm-up.
    fn steps_are_draws(&self) -> bool {
        false
    }

    /// The draws of a method whose steps are not draws themselves (populations that are cooled, live points,
    /// fits), from its last state; `None` where the points of each step are draws.
    fn harvest(
        &self,
        _target: &dyn Target,
        _state: &State,
        _stream: &Stream,
    ) -> Result<Option<Harvest>, Stop> {
        Ok(None)
    }

    /// What there is to tell of the last step of each chain beside its point: the same statistics in the same order of
    /// every state, that before the first step included. They are kept with the draws.
    fn statistics(&self, _state: &State) -> Vec<Statistic> {
        Vec::new()
    }

    /// Reasons not to trust the draws of a run that ended in this state, each with what would help; none
    /// when all is well.
    fn doubts(&self, _state: &State) -> Vec<String> {
        Vec::new()
    }

    /// What a person should know of a run that ended in this state although it is no reason to distrust the draws.
    fn notes(&self, _state: &State) -> Vec<String> {
        Vec::new()
    }

    /// What is worth telling about the method.
    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }
}

/// What a method brings home whose steps are not draws.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Harvest {
    /// Draws of equal weight in random order, one a row.
    pub points: Matrix,
    /// The log density of each.
    pub log_density: Vec<f64>,
    /// The number of independent draws that they are worth.
    pub effective_size: f64,
    /// The evidence, where the method gives it.
    pub evidence: Option<Evidence>,
    /// Reasons not to trust the draws, each with what would help; none when all is well.
    pub doubts: Vec<String>,
    /// What is worth telling.
    pub facts: Vec<Fact>,
}

/// The logarithm of the probability of the data: of the integral of likelihood times prior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Its value.
    pub log: f64,
    /// The standard error of that value.
    pub error: f64,
    /// How it was found, in words.
    pub method: String,
}

/// The size of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Plan {
    /// The number of chains.
    pub chains: usize,
    /// The number of steps of each.
    pub steps: usize,
    /// The number of first steps in which the method adapts itself: they are no draws, however short the burn-in.
    pub warm_up: usize,
    /// Whether the chains are walkers of one ensemble, and so not independent of each other.
    pub ensemble: bool,
}

/// What a sampler needs for its next step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The point of each chain, `chains x dimension`.
    pub points: Matrix,
    /// The log density there.
    pub log_density: Vec<f64>,
    /// Whether each chain moved in the last step.
    pub accepted: Vec<bool>,
    /// Evaluations of the log density so far.
    pub evaluations: u64,
    /// Whatever else the sampler keeps (an adapted covariance, a step size).
    pub memory: serde_json::Value,
}
