//! Temperatures, and how they adapt.

use serde::{Deserialize, Serialize};

/// Number of steps after which the adaptation is half as fast, and its initial time scale in steps (Vousden, Farr and
/// Mandel 2016, section 3.1; their program has these values for runs ten times as long).
const LAG: f64 = 1000.0;
const TIME: f64 = 10.0;
/// Fraction of exchanges below which the temperatures are too far apart.
pub const SELDOM: f64 = 0.02;
/// Ratio of neighbouring initial temperatures for one unknown, less one; it falls with the root of their number.
const SPACING: f64 = 6.0;

/// Powers of the likelihood, with the exchanges counted so far.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ladder {
    /// Powers of the likelihood (inverse temperatures), from 1 to 0.
    pub powers: Vec<f64>,
    /// Sum over steps of the fraction of exchanges between each pair of neighbours.
    exchanged: Vec<f64>,
    steps: f64,
}

impl Ladder {
    /// Geometric temperatures, the last one infinite.
    pub fn new(count: usize, dimension: usize) -> Self {
        let ratio = 1.0 + SPACING / (dimension as f64).sqrt();
        let mut powers: Vec<f64> = (0..count).map(|k| ratio.powi(-(k as i32))).collect();
        if let Some(last) = powers.last_mut() {
            *last = 0.0;
        }
        Self { powers, exchanged: vec![0.0; count - 1], steps: 0.0 }
    }

    /// Moves the temperatures so that all neighbours exchange equally often: with `S = log (T_k - T_(k-1))`, each step
    /// changes `S` by `κ(t) (A_k - A_(k+1))` for the fractions `A` of exchanges (equations 11 to 13 there).
    pub fn adapt(&mut self, exchanged: &[f64], step: usize) {
        let count = self.powers.len();
        let pace = LAG / (step as f64 + LAG) / TIME;
        let mut temperature = 1.0;
        let old: Vec<f64> = self.powers.iter().map(|power| 1.0 / power).collect();
        for k in 1..count - 1 {
            let change = pace * (exchanged[k - 1] - exchanged[k]);
            temperature += (old[k] - old[k - 1]) * change.exp();
            self.powers[k] = 1.0 / temperature;
        }
    }

    /// Counts the fractions of exchanges of a step.
    pub fn count(&mut self, exchanged: &[f64]) {
        self.exchanged.iter_mut().zip(exchanged).for_each(|(sum, share)| *sum += share);
        self.steps += 1.0;
    }

    /// Forgets the exchanges counted so far.
    pub fn forget(&mut self) {
        self.exchanged.fill(0.0);
        self.steps = 0.0;
    }

    /// Mean fraction of exchanges between each pair of neighbours.
    pub fn rates(&self) -> Vec<f64> {
        self.exchanged.iter().map(|sum| sum / self.steps.max(1.0)).collect()
    }
}
