//! Evidence by stepping stones, with its error from batches of steps.

use lacuna::math::moments;
use serde::{Deserialize, Serialize};

use super::levels::Levels;

/// Number of batches in a run of the planned length.
const BATCHES: usize = 25;
/// Smallest number of batches that give an error.
const FEWEST: usize = 8;

/// Ratios of the normalising constants of neighbouring temperatures, by batch of steps: the mean of the likelihood raised
/// to the difference of their powers, at the hotter of the two (Xie et al. 2011).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Number of steps of a batch.
    length: usize,
    /// Logarithm of the sum of each ratio over the steps of each batch.
    batches: Vec<Vec<f64>>,
    /// Number of steps of the last batch.
    steps: usize,
    pairs: usize,
}

impl Record {
    /// An empty record for a number of temperatures and of steps that are draws.
    pub fn new(temperatures: usize, steps: usize) -> Self {
        Self {
            length: (steps / BATCHES).max(1),
            batches: Vec::new(),
            steps: 0,
            pairs: temperatures - 1,
        }
    }

    /// Adds a step.
    pub fn add(&mut self, powers: &[f64], levels: &Levels) {
        if self.batches.is_empty() || self.steps == self.length {
            self.batches.push(vec![f64::MIN; self.pairs]);
            self.steps = 0;
        }
        self.steps += 1;
        let Some(batch) = self.batches.last_mut() else { return };
        for (pair, sum) in batch.iter_mut().enumerate() {
            let likelihood = levels.of_level(pair + 1);
            let power = powers[pair] - powers[pair + 1];
            let logs = likelihood.iter().map(|l| power * l);
            let mean = moments::log_sum(logs) - (likelihood.len() as f64).ln();
            // Files have no infinity.
            *sum = moments::log_sum([*sum, mean].into_iter()).max(f64::MIN);
        }
    }

    /// Logarithm of the evidence and its standard error; `None` if there are too few complete batches.
    ///
    /// The error is that of the mean over batches of the sum of all ratios, each divided by its mean: the delta method,
    /// with the correlation between temperatures.
    pub fn evidence(&self) -> Option<(f64, f64)> {
        let whole = self.batches.len() - usize::from(self.steps < self.length);
        if whole < FEWEST {
            return None;
        }
        let batches = &self.batches[..whole];
        let count = (whole as f64).ln();
        let mean = |pair: usize| moments::log_sum(batches.iter().map(|b| b[pair])) - count;
        let means: Vec<f64> = (0..self.pairs).map(mean).collect();
        let log = means.iter().map(|mean| mean - (self.length as f64).ln()).sum();
        let relative = |batch: &Vec<f64>| -> f64 {
            batch.iter().zip(&means).map(|(sum, mean)| (sum - mean).exp()).sum()
        };
        let sums: Vec<f64> = batches.iter().map(relative).collect();
        Some((log, (moments::variance(&sums) / whole as f64).sqrt()))
    }
}
