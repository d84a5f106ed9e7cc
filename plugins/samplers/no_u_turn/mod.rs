//! `no_u_turn`: chains that coast until they would turn back.

mod tree;

use lacuna::data::Statistic;
use lacuna::linalg::Matrix;
use lacuna::math::random::Stream;
use lacuna::plugin::sampler::{Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::study::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::hamiltonian::{Settings, Shape, chains, told};

/// No-U-turn sampler: Hamiltonian Monte Carlo whose trajectories end where they would turn back.
///
/// The method of choice when the posterior is smooth and has a gradient: it has no length to choose, copes
/// with hundreds of correlated unknowns, and says where it failed. Each step costs several gradients
/// and gives a draw that is nearly independent of the one before. Step size and shape of the posterior are
/// learnt in the warm-up, the shape from all chains together. Unknowns with bounds are moved in logarithms
/// or logits. Separate maxima are not visited in turn: a chain stays at the one it finds.
///
/// Divergent trajectories after the warm-up, whose energy error exceeds 1000, are counted: more than three that
/// are more than 0.1 % of all mean that the run has not converged; fewer are told as a note.
///
/// References: Hoffman and Gelman, J. Mach. Learn. Res. 15 (2014) 1593; Betancourt, A conceptual
/// introduction to Hamiltonian Monte Carlo, arXiv:1701.02434 (2017), appendix A (multinomial draws, the
/// criterion of the turn); Stan reference manual, chapter 15 (the windows of the warm-up, the
/// criterion across halves of a trajectory).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct NoUTurn {
    /// The number of independent chains.
    pub chains: usize,
    /// The number of steps of each chain, the warm-up included. A step is a whole trajectory.
    pub steps: usize,
    /// The number of first steps in which step size and metric are learnt; they are no draws.
    pub warm_up: usize,
    /// The largest number of times that a trajectory is doubled: at most `2^depth - 1` gradients a step.
    pub depth: u32,
    /// The mean acceptance along a trajectory at which the step size aims: larger means smaller steps
    /// and fewer divergences.
    pub target_acceptance: f64,
    /// Which shape of the posterior is learnt: by default all correlations for up to 20 unknowns, and only
    /// the scales for more.
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
        if !(1..=20).contains(&self.depth) {
            complaints
                .at("depth")
                .say("trajectories would have no or too many steps")
                .expected("a whole number from 1 to 20")
                .found(self.depth);
        }
    }
}

impl Sampler for NoUTurn {
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
