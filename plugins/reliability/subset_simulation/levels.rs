//! Levels of a subset simulation.

use lacuna::math::random::{Stream, permutation};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use super::chains::{Moves, correlation, grow};
use crate::reliability::common::normals;

/// Settings of a simulation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Number of samples of each level.
    pub samples: usize,
    /// Probability of a level, given the one before.
    pub share: f64,
    /// Largest number of levels.
    pub levels: usize,
}

/// Log weights of points, one per row.
pub type LogWeights<'a> = &'a dyn Fn(&Matrix) -> Vec<f64>;

/// Simulated limit state, with the weight of its variables and draws of them.
pub struct Simulated<'a> {
    /// Number of variables.
    pub dimension: usize,
    /// Values of the limit state at the rows of points; no failure above zero, never NaN.
    pub values: &'a dyn Fn(&Matrix) -> Result<Vec<f64>, Stop>,
    /// Logarithm of the weight at the rows of points; `None` for standard normal variables.
    pub log_weights: Option<LogWeights<'a>>,
    /// Draws of weighted variables.
    pub draws: Option<&'a Matrix>,
}

/// Samples of one level, chain after chain.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// Points (`samples x dimension`).
    pub points: Matrix,
    /// Values of the limit state.
    pub values: Vec<f64>,
    /// Lengths of the chains; ones on the first level.
    pub chains: Vec<usize>,
    /// Value that the next level lies below; zero on the last level.
    pub threshold: f64,
    /// Share of the samples not above the threshold.
    pub share: f64,
    /// Square of the coefficient of variation of the share.
    pub square: f64,
}

/// Result of a simulation.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The levels in their order.
    pub levels: Vec<Level>,
    /// Probability of failure.
    pub probability: f64,
    /// Coefficient of variation.
    pub variation: f64,
    /// True if the last level reaches the failure region with a share of at least that of a level.
    pub reached: bool,
}

impl Outcome {
    /// All samples (`points x dimension`) with weights that sum to one: each level stands for the samples above the threshold
    /// of the next one.
    pub fn weighted(&self) -> (Matrix, Vec<f64>) {
        let dimension = self.levels.first().map_or(0, |level| level.points.columns());
        let (mut points, mut weights) = (Matrix::zeros(0, dimension), Vec::new());
        let mut mass = 1.0;
        for (j, level) in self.levels.iter().enumerate() {
            let last = j + 1 == self.levels.len();
            let each = mass / level.values.len() as f64;
            for (point, value) in level.points.iter_rows().zip(&level.values) {
                if last || *value > level.threshold {
                    points.push_row(point);
                    weights.push(each);
                }
            }
            mass *= level.share;
        }
        (points, weights)
    }
}

/// Simulates level after level until the failure region holds the share of a level.
pub fn simulate(
    problem: &Simulated<'_>,
    settings: Settings,
    stream: &Stream,
) -> Result<Outcome, Stop> {
    let mut rng = stream.named("first").generator();
    let points = match problem.draws {
        None => normals(settings.samples, problem.dimension, &mut rng),
        Some(draws) => {
            let mut rows = permutation(&mut rng, draws.rows());
            rows.truncate(settings.samples);
            draws.select_rows(&rows)
        }
    };
    let values = (problem.values)(&points)?;
    let chains = vec![1; values.len()];
    let mut levels = vec![level(points, values, chains, settings.share)];
    let mut moves = Moves::new();
    loop {
        let last = &levels[levels.len() - 1];
        // A level all of whose samples are below the next threshold leads nowhere.
        let stuck = last.share >= 1.0 && last.threshold > 0.0;
        if last.threshold <= 0.0 || levels.len() >= settings.levels || stuck {
            break;
        }
        let random = stream.named("level").at(levels.len() as u64);
        let next = grow(problem, last, settings.samples, &mut moves, &random)?;
        levels.push(level(next.points, next.values, next.chains, settings.share));
    }
    let last = &levels[levels.len() - 1];
    let reached = last.threshold <= 0.0;
    let below = last.values.iter().filter(|value| **value <= 0.0).count();
    if !reached {
        let index = levels.len() - 1;
        levels[index].share = below as f64 / levels[index].values.len() as f64;
    }
    let probability = levels.iter().map(|level| level.share).product();
    let variation = levels.iter().map(|level| level.square).sum::<f64>().sqrt();
    Ok(Outcome { levels, probability, variation, reached })
}

/// A level with the threshold of the next one, at the given share of its samples or at zero.
fn level(points: Matrix, values: Vec<f64>, chains: Vec<usize>, share: f64) -> Level {
    let mut sorted = values.clone();
    sorted.sort_by(f64::total_cmp);
    let count = ((share * values.len() as f64).round() as usize).clamp(1, values.len());
    let next = sorted[count.min(values.len() - 1)];
    let middle = 0.5 * (sorted[count - 1] + next);
    let threshold = if middle.is_finite() { middle } else { sorted[count - 1] }.max(0.0);
    let below: Vec<bool> = values.iter().map(|value| *value <= threshold).collect();
    let inside = below.iter().filter(|b| **b).count();
    let p = inside as f64 / values.len() as f64;
    let gamma = correlation(&below, &chains, p);
    let square =
        if p > 0.0 { (1.0 - p) / (p * values.len() as f64) * (1.0 + gamma) } else { f64::INFINITY };
    Level { points, values, chains, threshold, share: p, square }
}
