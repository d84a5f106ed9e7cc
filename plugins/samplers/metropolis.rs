//! `metropolis`: random walks with a fixed normal proposal.

use lacuna::math::random::{Stream, uniform};
use lacuna::plugin::sampler::{Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use rand::rngs::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::chains;
use super::proposal::{Proposal, Shape, best_scale, normals};

/// Random-walk Metropolis: each chain proposes a normal step from its current point and accepts it with the
/// probability given by the ratio of the densities, or stays.
///
/// The oldest of the samplers and the easiest to reason about: nothing is adapted, all chains are independent of each
/// other, and each is an exact Markov chain from its first step. It is efficient only if the proposal fits the
/// density, as the curvature at the maximum does for densities that are nearly normal; otherwise prefer
/// `adaptive_metropolis`. The number of steps per independent draw is at best about five times the number of
/// unknowns.
///
/// References: Metropolis, Rosenbluth, Rosenbluth, Teller and Teller, J. Chem. Phys. 21 (1953) 1087; Roberts, Gelman
/// and Gilks, Ann. Appl. Probab. 7 (1997) 110 (the scale).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Metropolis {
    /// Number of independent chains, at least 2; convergence is judged by comparing them.
    pub chains: usize,
    /// Number of steps of each chain. A step costs one evaluation per chain.
    pub steps: usize,
    /// Covariance of the proposal: `"curvature"`, that of the normal approximation at the maximum of the density, or
    /// a fraction of the prior's width, such as `{ prior = 0.1 }`.
    pub proposal: Proposal,
    /// Factor on the length of the steps, above 0. With 1, the proposal's standard deviations are `2.38 / sqrt(d)`
    /// times those of its covariance for `d` unknowns, the optimum for normal densities; smaller steps are accepted
    /// more often.
    pub scale: f64,
}

impl Default for Metropolis {
    fn default() -> Self {
        Self { chains: 4, steps: 10_000, proposal: Proposal::Curvature, scale: 1.0 }
    }
}

impl Component for Metropolis {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        chains::check_count(self.chains, complaints);
        chains::check_steps(self.steps, 0, complaints);
        self.proposal.check(complaints);
        chains::check_positive("scale", self.scale, complaints);
    }
}

impl Sampler for Metropolis {
    fn steps_are_draws(&self) -> bool {
        true
    }

    fn plan(&self, _dimension: usize) -> Plan {
        Plan { chains: self.chains, steps: self.steps, warm_up: 0, ensemble: false }
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        chains::check_points(&points, self.chains, target.dimension(), "chains")?;
        let log_density = chains::log_density(target, &points, "chains")?;
        let (shape, evaluations) = self.proposal.shape(target, &points, &log_density)?;
        let mut state = chains::state(points, log_density, shape.into_numbers().into());
        state.evaluations += evaluations;
        Ok(state)
    }

    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        let shape = Shape::from_numbers(chains::numbers(&state.memory));
        let scale = self.scale * best_scale(state.points.columns());
        Trial::of_all(target, state, &shape, scale, stream).decide(state);
        Ok(())
    }

    fn facts(&self) -> Vec<Fact> {
        vec![Fact::new("chains", self.chains), Fact::new("steps", self.steps)]
    }
}

/// One proposed step of every chain, evaluated but not yet accepted or rejected.
pub(super) struct Trial {
    /// Proposed points, one row per chain.
    pub points: Matrix,
    /// Log density of each proposed point.
    pub log_density: Vec<f64>,
    /// Standard normal numbers that generated each proposal.
    pub normals: Vec<Vec<f64>>,
    /// Random generator of each chain.
    pub generators: Vec<ChaCha8Rng>,
}

impl Trial {
    /// Proposes for each chain a step of `scale` times the shape, and evaluates it.
    pub(super) fn of_all(
        target: &dyn Target,
        state: &mut State,
        shape: &Shape,
        scale: f64,
        stream: &Stream,
    ) -> Self {
        let (count, dimension) = (state.points.rows(), state.points.columns());
        let mut generators: Vec<ChaCha8Rng> =
            (0..count).map(|chain| stream.at(chain as u64).generator()).collect();
        let normals: Vec<Vec<f64>> =
            generators.iter_mut().map(|rng| normals(dimension, rng)).collect();
        let mut points = Matrix::zeros(count, dimension);
        for (chain, z) in normals.iter().enumerate() {
            shape.step(state.points.row(chain), scale, z, points.row_mut(chain));
        }
        let log_density = target.log_density(&points);
        state.evaluations += count as u64;
        Self { points, log_density, normals, generators }
    }

    /// Accepts or rejects each proposal by the ratio of the densities; returns the acceptance probability of each.
    pub(super) fn decide(&mut self, state: &mut State) -> Vec<f64> {
        let decided = (0..self.points.rows()).map(|chain| {
            let ratio = self.log_density[chain] - state.log_density[chain];
            // A NaN log density compares false, and the chain stays.
            let accepted = uniform(&mut self.generators[chain]).ln() < ratio;
            let (point, value) = (self.points.row(chain), self.log_density[chain]);
            chains::decide(state, chain, accepted, point, value);
            if ratio.is_nan() { 0.0 } else { ratio.min(0.0).exp() }
        });
        decided.collect()
    }
}

lacuna::register!(Sampler, "metropolis", Metropolis, aliases: ["mh", "metropolis_hastings", "random_walk"]);
