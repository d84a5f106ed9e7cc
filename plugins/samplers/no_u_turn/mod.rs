//! `no_u_turn`: chains whose trajectories end at a U-turn.

pub(crate) mod tree;

use lacuna::data::Statistic;
use lacuna::math::random::Stream;
use lacuna::plugin::sampler::{Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::hamiltonian::{Settings, Shape, chains, told};

/// No-U-turn sampler: Hamiltonian Monte Carlo whose trajectories end where they would turn back.
///
/// The method of choice if the posterior is smooth and has a gradient: no trajectory length has to be chosen, it
/// copes with hundreds of correlated unknowns, and it reports where it fails. Each step costs several gradients and
/// gives a draw that is nearly independent of the one before. Step size and metric are learnt in the warm-up, the
/// metric from all chains together. Unknowns with bounds are sampled as logarithms or logits. A chain stays at the
/// mode it finds: separate modes are not visited in turn.
///
/// Divergent trajectories, whose energy error exceeds 1000, are counted after the warm-up: if there are more than
/// three and more than 0.1 % of all, the run counts as not converged; fewer are reported as a note.
///
/// References: Hoffman and Gelman, J. Mach. Learn. Res. 15 (2014) 1593; Betancourt, A conceptual introduction to
/// Hamiltonian Monte Carlo, arXiv:1701.02434 (2017), appendix A (multinomial draws, U-turn criterion); Stan reference
/// manual, chapter 15 (the windows of the warm-up, the criterion across the halves of a trajectory).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct NoUTurn {
    /// Number of independent chains, at least 1; use several, because convergence is judged by comparing them.
    pub chains: usize,
    /// Number of steps of each chain, including the warm-up. A step is a whole trajectory and costs up to
    /// `2^depth - 1` gradients.
    pub steps: usize,
    /// Number of initial steps in which step size and metric are learnt, at least 20; they are discarded.
    pub warm_up: usize,
    /// Maximum tree depth, from 1 to 20: the number of times a trajectory may be doubled. It limits a step to
    /// `2^depth - 1` gradients; if many trajectories reach it, draws are strongly autocorrelated.
    pub depth: u32,
    /// Target mean acceptance rate along a trajectory to which the step size is tuned, from 0.1 to below 1. A larger
    /// value gives smaller steps: fewer divergences, more gradients.
    pub target_acceptance: f64,
    /// Form of the learnt metric. Default: `"dense"` (all correlations) for up to 20 unknowns, `"diagonal"` (scales
    /// only) for more.
    pub metric: Option<Shape>,
}

impl Default for NoUTurn {
    fn default() -> Self {
        Self {
            chains: 4,
            steps: 2000,
            warm_up: 1000,
            depth: 10,
            target_acceptance: 0.8,
            metric: None,
        }
    }
}

impl NoUTurn {
    fn settings(&self) -> Settings {
        Settings {
            chains: self.chains,
            steps: self.steps,
            warm_up: self.warm_up,
            target_acceptance: self.target_acceptance,
            metric: self.metric,
        }
    }
}

impl Component for NoUTurn {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.settings().check(complaints);
        tree::check_depth(self.depth, complaints);
    }
}

impl Sampler for NoUTurn {
    fn uses_gradient(&self) -> bool {
        true
    }

    fn steps_are_draws(&self) -> bool {
        true
    }

    fn plan(&self, _dimension: usize) -> Plan {
        self.settings().plan()
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        chains::start(&self.settings(), target, points)
    }

    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        chains::advance(&self.settings(), target, state, stream, |flow, point, step, rng| {
            tree::transition(flow, point, step, self.depth, rng)
        })
    }

    fn statistics(&self, state: &State) -> Vec<Statistic> {
        told::statistics(state, true)
    }

    fn doubts(&self, state: &State) -> Vec<String> {
        chains::doubts(&self.settings(), state)
    }

    fn notes(&self, state: &State) -> Vec<String> {
        chains::notes(&self.settings(), state)
    }

    fn facts(&self) -> Vec<Fact> {
        let mut facts = self.settings().facts();
        facts.push(Fact::new("largest depth", self.depth));
        facts
    }
}

lacuna::register!(Sampler, "no_u_turn", NoUTurn, aliases: ["nuts"]);

#[cfg(test)]
mod tests;
