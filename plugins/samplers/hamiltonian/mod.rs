//! `hamiltonian`: chains that follow Hamiltonian trajectories of a fixed length.

pub(crate) mod chains;
pub(crate) mod curvature;
mod leapfrog;
mod metric;
mod pace;
pub(crate) mod told;
mod windows;

use lacuna::data::Statistic;
use lacuna::math::random::{Stream, uniform};
use lacuna::plugin::sampler::{Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub(crate) use chains::{Settings, Transition};
pub(crate) use leapfrog::{Flow, LARGEST_ERROR, Phase, Point};
pub use metric::Shape;

/// Hamiltonian Monte Carlo: each chain gets a random momentum and follows the Hamiltonian dynamics of the log density
/// for a fixed time, guided by its gradient.
///
/// One trajectory carries a chain across the whole posterior, so that draws are nearly independent even with many
/// correlated unknowns, at the cost of a gradient for each leapfrog step. The step size and the metric (the shape of
/// the posterior) are learnt in the warm-up. `no_u_turn` also chooses the length of each trajectory and is the safer
/// choice; `hamiltonian` is faster if one length suits the whole posterior. Unknowns with bounds are sampled as
/// logarithms or logits, so that no trajectory reaches a bound. The density must be smooth.
///
/// Divergent trajectories, whose energy error exceeds 1000, are counted after the warm-up: if there are more than
/// three and more than 0.1 % of all, the run counts as not converged; fewer are reported as a note.
///
/// References: Neal, in Handbook of Markov Chain Monte Carlo (2011), chapter 5; Hoffman and Gelman, J. Mach. Learn.
/// Res. 15 (2014) 1593 (the step size); Stan reference manual, chapter 15 (the windows of the warm-up).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Hamiltonian {
    /// Number of independent chains, at least 1; use several, because convergence is judged by comparing them.
    pub chains: usize,
    /// Number of steps of each chain, including the warm-up. A step is a whole trajectory and costs one gradient per
    /// leapfrog step.
    pub steps: usize,
    /// Number of initial steps in which step size and metric are learnt, at least 20; they are discarded.
    pub warm_up: usize,
    /// Length of each trajectory.
    pub trajectory: Trajectory,
    /// Relative half-width of the uniform random variation of the trajectory length, from 0 to below 1. It prevents
    /// trajectories from returning periodically to their start.
    pub jitter: f64,
    /// Target acceptance rate to which the step size is tuned, from 0.1 to below 1. A larger value gives smaller
    /// steps: fewer divergences, more gradients.
    pub target_acceptance: f64,
    /// Form of the learnt metric. Default: `"dense"` (all correlations) for up to 20 unknowns, `"diagonal"` (scales
    /// only) for more.
    pub metric: Option<Shape>,
}

/// Length of a trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Trajectory {
    /// Integration time, in units in which a normal posterior has the period `2 pi`; a quarter of it, 1.57, makes
    /// draws from a normal density independent.
    Time(f64),
    /// Number of leapfrog steps, whatever their size.
    LeapfrogSteps(usize),
}

/// Maximum number of leapfrog steps of a trajectory, as in a tree of depth ten.
const MOST_STEPS: usize = 1023;

impl Default for Hamiltonian {
    fn default() -> Self {
        Self {
            chains: 4,
            steps: 2000,
            warm_up: 1000,
            trajectory: Trajectory::Time(std::f64::consts::FRAC_PI_2),
            jitter: 0.3,
            target_acceptance: 0.8,
            metric: None,
        }
    }
}

impl Hamiltonian {
    fn settings(&self) -> Settings {
        Settings {
            chains: self.chains,
            steps: self.steps,
            warm_up: self.warm_up,
            target_acceptance: self.target_acceptance,
            metric: self.metric,
        }
    }

    /// Integrates one trajectory from `from` with leapfrog steps of size `step`, and accepts or rejects its end.
    fn coast(&self, flow: &Flow<'_>, from: &Point, step: f64, rng: &mut impl Rng) -> Transition {
        let stretch = 1.0 + self.jitter * (2.0 * uniform(rng) - 1.0);
        let count = match self.trajectory {
            Trajectory::Time(time) => stretch * time / step,
            Trajectory::LeapfrogSteps(count) => stretch * count as f64,
        };
        let count = (count.round() as usize).clamp(1, MOST_STEPS);
        let mut phase = flow.push(from, rng);
        let energy = phase.energy();
        let mut gradients = 0;
        while gradients < count && phase.point.value.is_finite() {
            flow.leapfrog(&mut phase, step);
            gradients += 1;
        }
        let error = phase.energy() - energy;
        // NaN must not pass through `min`, which would return 1.
        let acceptance = if error.is_nan() { 0.0 } else { (-error).exp().min(1.0) };
        let accepted = uniform(rng) < acceptance;
        Transition {
            energy: if accepted { phase.energy() } else { energy },
            depth: None,
            point: if accepted { phase.point } else { from.clone() },
            moved: accepted,
            acceptance,
            gradients: gradients as u64,
            divergent: error.is_nan() || error > LARGEST_ERROR,
            saturated: false,
        }
    }
}

impl Component for Hamiltonian {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.settings().check(complaints);
        let (good, found) = match self.trajectory {
            Trajectory::Time(time) => (time > 0.0 && time.is_finite(), time.to_string()),
            Trajectory::LeapfrogSteps(count) => (count > 0, count.to_string()),
        };
        if !good {
            complaints
                .at("trajectory")
                .say("chains would not move")
                .expected("a number above 0")
                .found(found);
        }
        if !(0.0..1.0).contains(&self.jitter) {
            complaints
                .at("jitter")
                .say("a trajectory would have no length")
                .expected("a number from 0 to below 1")
                .found(self.jitter);
        }
    }
}

impl Sampler for Hamiltonian {
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
            self.coast(flow, point, step, rng)
        })
    }

    fn statistics(&self, state: &State) -> Vec<Statistic> {
        told::statistics(state, false)
    }

    fn doubts(&self, state: &State) -> Vec<String> {
        chains::doubts(&self.settings(), state)
    }

    fn notes(&self, state: &State) -> Vec<String> {
        chains::notes(&self.settings(), state)
    }

    fn facts(&self) -> Vec<Fact> {
        self.settings().facts()
    }
}

lacuna::register!(Sampler, "hamiltonian", Hamiltonian, aliases: ["hmc", "hamiltonian_monte_carlo"]);

#[cfg(test)]
pub(crate) mod laws;
#[cfg(test)]
mod tests;
