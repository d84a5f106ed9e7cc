//! Adaptation of proposals to the history of the chains.

use lacuna::math::moments::Moments;
use lacuna::plugin::Target;
use lacuna::plugin::sampler::State;
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::chains;
use super::proposal::{Proposal, Shape, best_scale};

/// Minimum number of accepted moves per unknown in a window; with fewer, the covariance of the window is not used.
const MOVES: usize = 10;
/// Relative increase of the variances of a learnt covariance, which keeps it positive definite.
const RIDGE: f64 = 1e-8;
/// Exponent `c` of the gain `n^-c` of the Robbins-Monro recursion, between 1/2 and 1 (Andrieu and Thoms 2008, section
/// 4).
const DECAY: f64 = 0.6;

/// Period during which the proposal is adapted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Adapt {
    /// During the warm-up only. Afterwards the proposal is fixed, and the chains are exact Markov chains that are
    /// independent of each other.
    WarmUp,
    /// Throughout the run, at growing intervals and with falling gain. The distribution of the chains still converges
    /// to the posterior (Chimisov, Latuszynski and Roberts, arXiv 1801.09309), but is not exact after any finite
    /// number of steps.
    Always,
}

/// Settings of the adaptation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rule {
    /// Number of warm-up steps of each chain.
    pub warm_up: usize,
    /// Period during which the proposal is adapted.
    pub adapt: Adapt,
    /// Target acceptance rate; `None` for the optimum of a normal density of the same dimension.
    pub acceptance: Option<f64>,
}

impl Rule {
    /// Reports an acceptance rate that is not between 0 and 1.
    pub(super) fn check(self, complaints: &mut Complaints<'_>) {
        if let Some(share) = self.acceptance.filter(|share| !(0.0 < *share && *share < 1.0)) {
            complaints
                .at("acceptance")
                .say("the acceptance rate must be between 0 and 1")
                .expected("a number between 0 and 1")
                .found(share);
        }
    }

    fn acceptance(self, dimension: usize) -> f64 {
        // Optimal acceptance rates for normal densities are 0.441, 0.352, 0.316, 0.279, 0.275 in one to five
        // dimensions (Gelman, Roberts and Gilks, Bayesian Statistics 5 (1996) 599, table 1) and 0.234 in many; the
        // formula agrees within 0.015.
        self.acceptance.unwrap_or(0.234 + 0.206 / dimension.max(1) as f64)
    }

    /// Length of the first window in steps. The shape is learnt at its end, and again whenever the number of steps
    /// has doubled.
    fn first_window(self) -> usize {
        if self.warm_up == 0 { 100 } else { (self.warm_up / 10).max(10) }
    }

    fn is_over(self, step: usize) -> bool {
        self.adapt == Adapt::WarmUp && step >= self.warm_up
    }

    /// Returns true if a window ends after `step` steps, i.e. after 1, 2, 4, 8, ... times the first window.
    fn ends_window(self, step: usize) -> bool {
        let first = self.first_window();
        step.is_multiple_of(first) && (step / first).is_power_of_two()
    }
}

/// A proposal with the state of its adaptation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Adaptive {
    /// Shape of the proposal: the Cholesky factor of its covariance up to `scale`.
    pub shape: Shape,
    /// Factor on the standard deviations of `shape`.
    pub scale: f64,
    /// State of the adaptation; `None` once it has ended.
    learning: Option<Learning>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Learning {
    step: usize,
    /// Accepted moves of all chains in the current window.
    moves: usize,
    /// Moments of the points of all chains in the current window.
    window: Moments,
}

impl Adaptive {
    /// Returns the state of `count` chains before their first step. `points` has one row per chain
    /// (`count x dimension`).
    pub(super) fn start(
        target: &dyn Target,
        points: Matrix,
        count: usize,
        proposal: Proposal,
        rule: Rule,
    ) -> Result<State, Stop> {
        let dimension = target.dimension();
        chains::check_points(&points, count, dimension, "chains")?;
        let log_density = chains::log_density(target, &points, "chains")?;
        let (shape, evaluations) = proposal.shape(target, &points, &log_density)?;
        let memory = Self::new(shape, dimension, rule).written()?;
        let mut state = chains::state(points, log_density, memory);
        state.evaluations += evaluations;
        Ok(state)
    }

    fn new(shape: Shape, dimension: usize, rule: Rule) -> Self {
        let learning = Learning { step: 0, moves: 0, window: Moments::new(dimension) };
        let learning = (!rule.is_over(0)).then_some(learning);
        Self { shape, scale: best_scale(dimension), learning }
    }

    /// Reads the proposal from the memory of a state.
    pub(super) fn read(state: &State) -> Result<Self, Stop> {
        Self::deserialize(&state.memory)
            .map_err(|error| Stop::new(format!("the saved proposal cannot be read: {error}")))
    }

    /// Returns the proposal as the memory of a state.
    fn written(&self) -> Result<serde_json::Value, Stop> {
        serde_json::to_value(self)
            .map_err(|error| Stop::new(format!("the proposal cannot be saved: {error}")))
    }

    /// Adapts the proposal after a step, from the current points of the chains and the acceptance probabilities of
    /// their moves, `chances`, one per chain.
    ///
    /// The scale follows the Robbins-Monro recursion (algorithm 4 of Andrieu and Thoms). The shape becomes the
    /// covariance of the later half of the history (Haario, Saksman and Tamminen 2001, equation 1), pooled over all
    /// chains, after 1, 2, 4, 8, ... tenths of the warm-up.
    pub(super) fn learn(
        &mut self,
        state: &mut State,
        chances: &[f64],
        rule: Rule,
    ) -> Result<(), Stop> {
        let Some(learning) = &mut self.learning else { return Ok(()) };
        let dimension = state.points.columns();
        learning.step += 1;
        learning.moves += state.accepted.iter().filter(|a| **a).count();
        state.points.iter_rows().for_each(|point| learning.window.add(point));
        let gain = (learning.step as f64).powf(-DECAY);
        let share = chances.iter().sum::<f64>() / chances.len() as f64;
        self.scale *= (gain * (share - rule.acceptance(dimension))).exp();
        let step = learning.step;
        if rule.ends_window(step) && step > 0 {
            let told = learning.moves >= MOVES * dimension;
            let shape = told.then(|| learnt(&learning.window)).flatten();
            if let Some(shape) = shape {
                // The scale restarts at the optimum of a normal density: the old one was tuned to the old shape.
                (self.shape, self.scale) = (shape, best_scale(dimension));
            }
            *learning = Learning { step, moves: 0, window: Moments::new(dimension) };
        }
        if rule.is_over(step) {
            self.learning = None;
        }
        state.memory = self.written()?;
        Ok(())
    }
}

fn learnt(window: &Moments) -> Option<Shape> {
    let mut covariance = window.covariance();
    (0..covariance.rows()).for_each(|j| covariance[(j, j)] *= 1.0 + RIDGE);
    Shape::of(&covariance)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lacuna::math::distribution::Distribution;
    use lacuna::math::random::Stream;
    use lacuna::plugin::Sampler;

    use super::super::adaptive_metropolis::AdaptiveMetropolis;
    use super::super::truth::Density;
    use super::*;

    #[test]
    fn windows_double() {
        let rule = Rule { warm_up: 1000, adapt: Adapt::Always, acceptance: None };
        let ends: Vec<usize> = (1..=4000).filter(|&step| rule.ends_window(step)).collect();
        assert_eq!(ends, [100, 200, 400, 800, 1600, 3200]);
        let shares = [1, 2, 5, 1000].map(|d| rule.acceptance(d));
        for (share, best) in shares.into_iter().zip([0.441, 0.352, 0.275, 0.234]) {
            assert!((share - best).abs() < 0.02, "{share}");
        }
    }

    #[test]
    fn a_walk_learns_the_covariance_and_then_keeps_it() {
        // A strongly correlated normal density, and an initial proposal that is a hundred times too wide.
        let priors = vec![Distribution::Normal([0.0, 100.0]), Distribution::Normal([0.0, 1.0])];
        let target = Density::new(priors, |x: &[f64]| {
            let (u, v) = (x[0], 100.0 * x[1]);
            -0.5 * (u * u + v * v - 1.9 * u * v) / (1.0 - 0.95 * 0.95)
        });
        let proposal = Proposal::Prior(1.0);
        let sampler = AdaptiveMetropolis { warm_up: 2000, proposal, ..Default::default() };
        let points = Matrix::from_fn(4, 2, |i, j| [i as f64, 1e-2 * i as f64][j]);
        let mut state = sampler.start(&target, points).unwrap();
        let root = Stream::root(3);
        let mut moved = 0;
        for step in 0..6000 {
            sampler.step(&target, &mut state, &root.at(step)).unwrap();
            if step == 2000 {
                let learnt = Adaptive::read(&state).unwrap();
                assert!(learnt.learning.is_none());
                // The Cholesky factor of [[1, 0.95e-2], [0.95e-2, 1e-4]]; the last window has 3200 points.
                let numbers = learnt.shape.into_numbers();
                for (found, expected) in numbers.iter().zip([1.0, 0.95e-2, 0.312e-2]) {
                    assert!((found / expected - 1.0).abs() < 0.25, "{numbers:?}");
                }
            }
            if step > 2000 {
                moved += state.accepted.iter().filter(|a| **a).count();
            }
        }
        let share = moved as f64 / (4.0 * 3999.0);
        assert!((share - 0.337).abs() < 0.05, "acceptance {share}");
    }

    #[test]
    fn a_memory_that_is_none_is_an_error() {
        let state = chains::state(Matrix::zeros(1, 1), vec![0.0], serde_json::Value::Null);
        assert!(Adaptive::read(&state).unwrap_err().message.contains("cannot be read"));
    }
}
