//! Samplers: draws from a log density.

use lacuna_base::data::Statistic;
use lacuna_base::math::random::Stream;
use lacuna_base::matrix::Matrix;
use lacuna_base::run::Stop;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Component, Fact};

pub use lacuna_base::math::Target;

/// Draws from a log density step by step.
pub trait Sampler: Component {
    /// Number of chains (walkers) and steps of a run on a density of this dimension.
    fn plan(&self, dimension: usize) -> Plan;

    /// Returns true if the chains begin at the given starting points. A method that draws its own points from the prior
    /// returns false: it is then given draws of the prior, whatever their density, and the search for starting points
    /// is skipped.
    fn uses_starts(&self) -> bool {
        true
    }

    /// Returns true if the method needs derivatives of the log density, which an estimated density does not have.
    fn uses_gradient(&self) -> bool {
        false
    }

    /// Distribution of the starting points if the study does not choose one.
    fn start_where(&self) -> Start {
        Start::Map
    }

    /// State before the first step; `points` holds one starting point per chain (`chains x dimension`).
    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop>;

    /// Performs one step of all chains. `stream` belongs to this step alone.
    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop>;

    /// Returns true if this state is the last one, regardless of the number of steps of the plan.
    fn finished(&self, _state: &State) -> bool {
        false
    }

    /// Returns true if the points of each step are draws, so that a run may end after any number of steps past the
    /// warm-up.
    fn steps_are_draws(&self) -> bool {
        false
    }

    /// Draws of a method whose steps are not draws themselves (tempered populations, live points, fits), from its last
    /// state; `None` if the points of each step are draws.
    fn harvest(
        &self,
        _target: &dyn Target,
        _state: &State,
        _stream: &Stream,
    ) -> Result<Option<Harvest>, Stop> {
        Ok(None)
    }

    /// Evidence that a method whose steps are draws estimates besides them, from its last state; `None` if it estimates
    /// none.
    fn evidence(&self, _state: &State) -> Option<Evidence> {
        None
    }

    /// Statistics of the last step of each chain: the same ones in the same order for every state, including the one
    /// before the first step. They are stored with the draws.
    fn statistics(&self, _state: &State) -> Vec<Statistic> {
        Vec::new()
    }

    /// Reasons not to trust the draws of a run that ended in this state, each with a remedy; empty if there are none.
    fn doubts(&self, _state: &State) -> Vec<String> {
        Vec::new()
    }

    /// Notes on a run that ended in this state that are no reason to distrust the draws.
    fn notes(&self, _state: &State) -> Vec<String> {
        Vec::new()
    }

    /// Facts about the method, for the report.
    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }
}

/// Result of a method whose steps are not draws.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Harvest {
    /// Draws of equal weight in random order, `draws x dimension`.
    pub points: Matrix,
    /// Log density of each draw.
    pub log_density: Vec<f64>,
    /// Effective sample size of the draws.
    pub effective_size: f64,
    /// Evidence, if the method estimates it.
    pub evidence: Option<Evidence>,
    /// Reasons not to trust the draws, each with a remedy; empty if there are none.
    pub doubts: Vec<String>,
    /// Facts for the report.
    pub facts: Vec<Fact>,
}

/// Logarithm of the evidence (marginal likelihood): of the integral of likelihood times prior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Natural logarithm of the evidence.
    pub log: f64,
    /// Standard error of the logarithm.
    pub error: f64,
    /// Method of estimation, as text.
    pub method: String,
}

/// Distribution of the starting points of chains.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// Scattered around the maximum of the posterior density (MAP), which is found by optimisation, according to its
    /// curvature.
    Map,
    /// Independent draws from the prior. With a wide prior, walkers may get stranded.
    Prior,
    /// A Sobol' sequence through the prior, more evenly distributed than independent draws.
    Sobol,
}

/// Size of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Plan {
    /// Number of chains.
    pub chains: usize,
    /// Number of steps of each chain.
    pub steps: usize,
    /// Number of initial steps in which the method adapts; they are not draws, however short the burn-in.
    pub warm_up: usize,
    /// True if the chains are walkers of one ensemble and therefore not independent.
    pub ensemble: bool,
}

/// State of a sampler between two steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Current point of each chain, `chains x dimension`.
    pub points: Matrix,
    /// Log density at each point.
    pub log_density: Vec<f64>,
    /// For each chain, true if it moved in the last step.
    pub accepted: Vec<bool>,
    /// Number of evaluations of the log density so far.
    pub evaluations: u64,
    /// Further state of the sampler, such as an adapted covariance or step size.
    pub memory: serde_json::Value,
}
