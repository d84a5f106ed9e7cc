//! Proposals that learn from the history of the chains.

use lacuna::linalg::Matrix;
use lacuna::math::moments::Moments;
use lacuna::plugin::Target;
use lacuna::plugin::sampler::State;
use lacuna::run::Stop;
use lacuna::study::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::chains;
use super::proposal::{Proposal, Shape, best_scale};

/// Accepted moves per unknown below which a window tells no covariance.
const MOVES: usize = 10;
/// The part of its own variance that is added to each coordinate of a learnt covariance.
const RIDGE: f64 = 1e-8;
/// The power with which gains fall, between 1/2 and 1 (Andrieu and Thoms 2008, section 4).
const DECAY: f64 = 0.6;

/// How long a proposal goes on learning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Adapt {
    /// During the warm-up: after it the proposal is fixed, and all chains are exact Markov chains
    /// that are independent of each other.
    WarmUp,
    /// To the end, ever more rarely and in ever smaller steps. The distribution of the chains converges
    /// all the same (Chimisov, Latuszynski and Roberts, arXiv 1801.09309), but is not exact after any
    /// number of steps.
    Always,
}

/// What a proposal learns by.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rule {
    /// The number of steps of the warm-up.
    pub warm_up: usize,
    /// When it ends.
    pub adapt: Adapt,
    /// The share of accepted moves to aim at.
    pub acceptance: Option<f64>,
}

impl Rule {
    /// Complains of a share of accepted moves that is none.
    pub(super) fn check(self, complaints: &mut Complaints<'_>) {
        if let Some(share) = self.acceptance.filter(|share| !(0.0 < *share && *share < 1.0)) {
            complaints
                .at("acceptance")
                .say("a share of accepted moves lies between none and all")
                .expected("a number between 0 and 1")
                .found(share);
        }
    }

    fn acceptance(self, dimension: usize) -> f64 {
        // Best for normal laws: 0.441, 0.352, 0.316, 0.279, 0.275 in one to five dimensions (Gelman, Roberts
        // and Gilks, Bayesian Statistics 5 (1996) 599, table 1), 0.234 in many.
        self.acceptance.unwrap_or(0.234 + 0.206 / dimension.max(1) as f64)
    }

    /// The first step after which the shape is learnt; each next is twice as far.
    fn first_window(self) -> usize {
        if self.warm_up == 0 { 100 } else { (self.warm_up / 10).max(10) }
    }

    fn is_over(self, step: usize) -> bool {
        self.adapt == Adapt::WarmUp && step >= self.warm_up
    }

    /// Whether a window ends after this many steps.
    fn ends_window(self, step: usize) -> bool {
        let first = self.first_window();
        step.is_multiple_of(first) && (step / first).is_power_of_two()
    }
}

/// A proposal with what it has learnt so far.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Adaptive {
    /// The shape of the steps.
    pub shape: Shape,
    /// Their scale.
    pub scale: f64,
    /// What is being learnt; none when learning is over.
    learning: Option<Learning>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Learning {
    step: usize,
    /// Accepted moves of all chains since the shape was learnt last.
    moves: usize,
    /// The points of all chains since then.
    window: Moments,
}

impl Adaptive {
    /// The state of `count` chains before their first step.
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

    /// The proposal that a state keeps.
    pub(super) fn read(state: &State) -> Result<Self, Stop> {
        Self::deserialize(&state.memory)
            .map_err(|error| Stop::new(format!("the saved proposal cannot be read: {error}")))
    }

    /// The proposal as a state keeps it.
    fn written(&self) -> Result<serde_json::Value, Stop> {
        serde_json::to_value(self)
            .map_err(|error| Stop::new(format!("the proposal cannot be saved: {error}")))
    }

    /// Learns from a step: from the points where the chains now are, and from the probabilities with which
    /// their moves were accepted.
    ///
    /// The scale follows Robbins and Monro's rule (algorithm 4 of Andrieu and Thoms). The shape becomes the
    /// covariance of the later half of the history (Haario, Saksman and Tamminen 2001, equation
    /// 1), of all chains together, after 1, 2, 4, 8 ... times a tenth of the warm-up.
    pub(super) fn learn(&mut self, state: &mut State, chances: &[f64], rule: Rule) -> Result<(), Stop> {
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
