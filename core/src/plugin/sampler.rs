//! Samplers: draws from a log density.

use serde::{Deserialize, Serialize};

use super::{Component, Fact};
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::run::Stop;

/// A log density to draw from.
///
/// Coordinates are those of the posterior: parameters in physical units, hyperparameters that are
/// declared so in logarithms.
pub trait Target: Sync {
    /// The number of coordinates.
    fn dimension(&self) -> usize;

    /// The log density at each row of `points`; minus infinity outside the support, never NaN.
    fn log_density(&self, points: &Matrix) -> Vec<f64>;

    /// The log density at a point and its gradient.
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>);

    /// The closed interval of each coordinate (infinite where it has no bound).
    fn bounds(&self) -> Vec<(f64, f64)>;

    /// Independent draws from the prior, one a row.
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix;
}

/// Draws from a log density step by step.
pub trait Sampler: Component {
    /// How many chains (walkers) and steps a run has on a density of this dimension.
    fn plan(&self, dimension: usize) -> Plan;

    /// The state before the first step, from one starting point a chain.
    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop>;

    /// One step of all chains. `stream` belongs to this step alone.
    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop>;

    /// What is worth telling about the method.
    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }
}

/// The size of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Plan {
    /// The number of chains.
    pub chains: usize,
    /// The number of steps of each.
    pub steps: usize,
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
