//! `delayed_rejection_adaptive_metropolis`: adaptive random walks with a second, shorter trial step.

use lacuna::math::random::{Stream, uniform};
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
use super::proposal::{Proposal, normals};

/// Delayed-rejection adaptive Metropolis (DRAM): a chain whose step is rejected tries a shorter one before it stays
/// where it is.
///
/// The second trial costs a second evaluation and has its own acceptance probability, which keeps the stationary
/// distribution exact. It helps where no single step length suits the whole density: curved ridges, bounds, or an
/// initial proposal that is far too wide. On nearly normal densities `adaptive_metropolis` does as well with fewer
/// evaluations. Everything else is as in `adaptive_metropolis`.
///
/// References: Haario, Laine, Mira and Saksman, Statistics and Computing 16 (2006) 339; Tierney and Mira, Statistics
/// in Medicine 18 (1999) 2507 (the second acceptance probability).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DelayedRejectionAdaptiveMetropolis {
    /// Number of chains, at least 2; convergence is judged by comparing them.
    pub chains: usize,
    /// Number of steps of each chain, including the warm-up. A step costs one evaluation per chain, and a second one
    /// for each rejected trial.
    pub steps: usize,
    /// Number of initial steps in which the proposal is adapted; they are discarded.
    pub warm_up: usize,
    /// Period during which the proposal is adapted.
    pub adapt: Adapt,
    /// Covariance of the initial proposal: `"curvature"`, that of the normal approximation at the maximum of the
    /// density, or a fraction of the prior's width, such as `{ prior = 0.1 }`.
    pub proposal: Proposal,
    /// Target acceptance rate of the first trial, between 0 and 1, to which the length of the steps is tuned.
    /// Default: the optimum for normal densities, 0.44 for one unknown, falling to 0.234 for many.
    pub acceptance: Option<f64>,
    /// Length of second trial steps as a fraction of that of first ones; above 0.
    pub shrink: f64,
}

impl Default for DelayedRejectionAdaptiveMetropolis {
    fn default() -> Self {
        Self {
            chains: 4,
            steps: 10_000,
            warm_up: 2000,
            adapt: Adapt::WarmUp,
            proposal: Proposal::Curvature,
            acceptance: None,
            shrink: 0.2,
        }
    }
}

impl DelayedRejectionAdaptiveMetropolis {
    fn rule(&self) -> Rule {
        Rule { warm_up: self.warm_up, adapt: self.adapt, acceptance: self.acceptance }
    }

    /// Tries a second, shorter step for every chain whose first trial was rejected.
    fn try_again(
        &self,
        target: &dyn Target,
        state: &mut State,
        proposal: &Adaptive,
        first: &mut Trial,
    ) {
        let left: Vec<usize> = (0..state.accepted.len()).filter(|&c| !state.accepted[c]).collect();
        if left.is_empty() {
            return;
        }
        let dimension = state.points.columns();
        let mut points = Matrix::zeros(left.len(), dimension);
        let mut tries = Vec::with_capacity(left.len());
        for (row, &chain) in left.iter().enumerate() {
            let z = normals(dimension, &mut first.generators[chain]);
            let scale = self.shrink * proposal.scale;
            proposal.shape.step(state.points.row(chain), scale, &z, points.row_mut(row));
            tries.push(z);
        }
        let log_density = target.log_density(&points);
        state.evaluations += left.len() as u64;
        for (row, &chain) in left.iter().enumerate() {
            let ratio = second_ratio(
                [state.log_density[chain], first.log_density[chain], log_density[row]],
                &first.normals[chain],
                &tries[row],
                self.shrink,
            );
            let accepted = uniform(&mut first.generators[chain]).ln() < ratio;
            chains::decide(state, chain, accepted, points.row(row), log_density[row]);
        }
    }
}

/// Returns the logarithm of the acceptance ratio of a second trial (Haario et al. 2006, equation 2):
/// `pi(y2) q(y2, y1) [1 - a(y2, y1)] / (pi(x) q(x, y1) [1 - a(x, y1)])`, with `q` the proposal density and `a` the
/// acceptance probability of first trials.
///
/// `densities` are the logarithms of `pi` at `x`, `y1` and `y2`; the points are `y1 = x + L z1` and
/// `y2 = x + shrink L z2`, so that `y1 - y2 = L (z1 - shrink z2)`. The proposal density of the second trial itself is
/// symmetric and cancels.
fn second_ratio(densities: [f64; 3], z1: &[f64], z2: &[f64], shrink: f64) -> f64 {
    let [at_x, at_y1, at_y2] = densities;
    // ln(1 - min(1, pi(y1) / pi(from))).
    let ln_rejected = |from: f64| {
        if at_y1.is_nan() { 0.0 } else { (-(at_y1 - from).min(0.0).exp_m1()).ln() }
    };
    if !at_y2.is_finite() {
        return f64::NEG_INFINITY;
    }
    let from_y2: f64 = z1.iter().zip(z2).map(|(a, b)| (a - shrink * b).powi(2)).sum();
    let from_x: f64 = z1.iter().map(|a| a * a).sum();
    at_y2 - at_x - 0.5 * (from_y2 - from_x) + ln_rejected(at_y2) - ln_rejected(at_x)
}

impl Component for DelayedRejectionAdaptiveMetropolis {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        chains::check_count(self.chains, complaints);
        chains::check_steps(self.steps, self.warm_up, complaints);
        self.proposal.check(complaints);
        self.rule().check(complaints);
        chains::check_positive("shrink", self.shrink, complaints);
    }
}

impl Sampler for DelayedRejectionAdaptiveMetropolis {
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
        self.try_again(target, state, &proposal, &mut trial);
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

lacuna::register!(Sampler, "delayed_rejection_adaptive_metropolis", DelayedRejectionAdaptiveMetropolis, aliases: ["dram"]);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_step_and_its_reverse_are_in_balance() {
        // The ratio of the reverse move is the inverse: detailed balance through the same rejected point.
        let density = |x: f64| -0.5 * x * x - (1.0 + x * x).ln();
        let shrink = 0.3;
        let mut tried = 0;
        for i in 0..400 {
            let draw = |k: i32| 3.0 * (f64::from(k * 37 + i * 101) * 0.618).sin();
            let (x, z1, z2) = (draw(1), draw(2), draw(3));
            let (y1, y2) = (x + z1, x + shrink * z2);
            let at = [density(x), density(y1), density(y2)];
            if at[1] >= at[0].min(at[2]) {
                continue;
            }
            tried += 1;
            let there = second_ratio(at, &[z1], &[z2], shrink);
            let back = second_ratio([at[2], at[1], at[0]], &[y1 - y2], &[-z2], shrink);
            assert!((there + back).abs() < 1e-9 * there.abs().max(1.0), "{there} and {back}");
        }
        assert!(tried > 50);
    }

    #[test]
    fn a_second_step_beside_a_better_rejected_point_is_never_taken() {
        // From y2 the first trial would certainly have been accepted, so that the reverse move is impossible.
        let ratio = second_ratio([0.0, -1.0, -2.0], &[1.0], &[1.0], 0.2);
        assert_eq!(ratio, f64::NEG_INFINITY);
        assert_eq!(
            second_ratio([0.0, -1.0, f64::NEG_INFINITY], &[1.0], &[1.0], 0.2),
            f64::NEG_INFINITY
        );
    }
}
