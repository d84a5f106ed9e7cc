//! `adaptive_metropolis`: random walks that learn the covariance of the density.

use lacuna::math::random::Stream;
use lacuna::plugin::sampler::{Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::adaptation::{Adapt, Adaptive, Rule};
use super::chains;
use super::metropolis::Trial;
use super::proposal::Proposal;

/// Adaptive Metropolis: a random walk whose normal proposal takes the covariance of the chains' history and a length
/// tuned to a target acceptance rate.
///
/// It needs no gradient and no tuning. It suits up to about thirty unknowns and densities with a single mode and
/// without strongly curved ridges. All chains adapt one common proposal during the warm-up; afterwards the proposal
/// is fixed and the chains are independent. Increase `warm_up` with the number of unknowns.
///
/// References: Haario, Saksman and Tamminen, Bernoulli 7 (2001) 223; Andrieu and Thoms, Statistics and Computing 18
/// (2008) 343 (the scale); Craiu, Rosenthal and Yang, JASA 104 (2009) 1454 (chains that adapt together).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AdaptiveMetropolis {
    /// Number of chains, at least 2; convergence is judged by comparing them.
    pub chains: usize,
    /// Number of steps of each chain, including the warm-up. A step costs one evaluation per chain.
    pub steps: usize,
    /// Number of initial steps in which the proposal is adapted; they are discarded.
    pub warm_up: usize,
    /// Period during which the proposal is adapted.
    pub adapt: Adapt,
    /// Covariance of the initial proposal: `"curvature"`, that of the normal approximation at the maximum of the
    /// density, or a fraction of the prior's width, such as `{ prior = 0.1 }`.
    pub proposal: Proposal,
    /// Target acceptance rate, between 0 and 1, to which the length of the steps is tuned. Default: the optimum for
    /// normal densities, 0.44 for one unknown, falling to 0.234 for many.
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
