//! `adaptive_metropolis`: random walks that learn the shape of the density.

use lacuna::linalg::Matrix;
use lacuna::math::random::Stream;
use lacuna::plugin::sampler::{Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::study::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::adaptation::{Adapt, Adaptive, Rule};
use super::chains;
use super::metropolis::Trial;
use super::proposal::Proposal;

/// Adaptive Metropolis: random walks whose normal proposal takes the covariance of the chains' own
/// history, and whose length is tuned to the best share of accepted moves.
///
/// It needs no gradient and no tuning, and suits up to some thirty unknowns whose density has one mode and no
/// strong bends. All chains learn together during the warm-up; afterwards the proposal is fixed and
/// the chains are independent. Give it a longer `warm_up` the more unknowns there are.
///
/// References: Haario, Saksman and Tamminen, Bernoulli 7 (2001) 223; Andrieu and Thoms, Statistics and
/// Computing 18 (2008) 343 (the scale); Craiu, Rosenthal and Yang, JASA 104 (2009) 1454 (chains that
/// learn together).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AdaptiveMetropolis {
    /// The number of chains: at least two.
    pub chains: usize,
    /// The number of steps of each chain, those of the warm-up included.
    pub steps: usize,
    /// The number of first steps in which the proposal learns; they are no draws.
    pub warm_up: usize,
    /// When learning ends.
    pub adapt: Adapt,
    /// The shape of the proposal before anything is learnt: `"curvature"`, the normal law that touches
    /// the density at its maximum, or a fraction of the width of the prior, such as `{ prior = 0.1 }`.
    pub proposal: Proposal,
    /// The share of accepted moves to which the length of the steps is tuned. The best for normal
    /// densities when it is not given: 0.44 for one unknown, falling to 0.234 for many.
    pub acceptance: Option<f64>,
}

impl Default for AdaptiveMetropolis {
    fn default() -> Self {
        Self {
            chains: 4,
            steps: 10_000,
            warm_up: 2000,
            adapt: Adapt::WarmUp,
            proposal: Proposal::Curvature,
            acceptance: None,
        }
    }
}

impl AdaptiveMetropolis {
    fn rule(&self) -> Rule {
        Rule { warm_up: self.warm_up, adapt: self.adapt, acceptance: self.acceptance }
    }
}

impl Component for AdaptiveMetropolis {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        chains::check_count(self.chains, complaints);
        chains::check_steps(self.steps, self.warm_up, complaints);
        self.proposal.check(complaints);
        self.rule().check(complaints);
    }
}

impl Sampler for AdaptiveMetropolis {
    fn steps_are_draws(&self) -> bool {
        true
    }

    fn plan(&self, _dimension: usize) -> Plan {
        Plan { chains: self.chains, steps: self.steps, warm_up: self.warm_up, ensemble: false }
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        Adaptive::start(target, points, self.chains, self.proposal, self.rule())
    }

    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        let mut proposal = Adaptive::read(state)?;
        let mut trial = Trial::of_all(target, state, &proposal.shape, proposal.scale, stream);
        let chances = trial.decide(state);
        proposal.learn(state, &chances, self.rule())
    }

    fn facts(&self) -> Vec<Fact> {
        vec![
            Fact::new("chains", self.chains),
            Fact::new("steps", self.steps),
            Fact::new("steps of the warm-up", self.warm_up),
        ]
    }
}

lacuna::register!(Sampler, "adaptive_metropolis", AdaptiveMetropolis, aliases: ["am", "haario"]);
