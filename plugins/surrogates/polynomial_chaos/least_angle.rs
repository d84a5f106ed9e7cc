//! Least-angle regression, with the leave-one-out error of the least-squares fit at every step.
//!
//! The path is that of Efron, Hastie, Johnstone and Tibshirani (2004) on columns with zero mean and unit length; no
//! term ever leaves it. At each step the terms so far are refitted by least squares and assessed by their corrected
//! leave-one-out error ("hybrid" selection: Blatman and Sudret 2011), which is exactly the error of the final model.
//!
//! The speed comes from four things: inner products of the basis functions are shared by all outputs, so that the
//! path does not depend on the number of runs; only candidates that can enter are followed ([`super::candidates`]); the inverse Cholesky
//! factor of the active Gram matrix grows by one column per step; and the orthonormal columns needed for leverages
//! and residuals are computed for a block of steps at a time by one matrix product.

use lacuna_linalg::vector;

use super::candidates::{Arrival, Candidates, Direction};
use super::dictionary::{ActiveSet, Dictionary};
use super::judge::Path;

/// State of the path: active terms and direction.
pub(super) struct LeastAngle<'a> {
    active: ActiveSet<'a>,
    candidates: Candidates<'a>,
    /// Common size of the active correlations.
    level: f64,
    signs: Vec<f64>,
    /// Direction as a combination of the active columns: `G^-1 signs`.
    weights: Vec<f64>,
}

impl<'a> LeastAngle<'a> {
    /// Starts the path; `correlations` are the output's products with the dictionary's columns.
    pub fn new(dictionary: &'a Dictionary, correlations: &[f64]) -> Self {
        Self {
            active: ActiveSet::new(dictionary),
            candidates: Candidates::new(dictionary, correlations),
            level: 0.0,
            signs: Vec::new(),
            weights: Vec::new(),
        }
    }

    /// Moves along the current direction until a candidate is as correlated as the active terms.
    fn advance(&mut self) -> Option<Arrival> {
        if self.active.terms().is_empty() {
            let strongest = self.candidates.strongest()?;
            self.level = strongest.correlation.abs();
            return Some(strongest);
        }
        let arrival = self.candidates.advance(&Direction {
            active: self.active.terms(),
            weights: &self.weights,
            level: self.level,
        })?;
        self.level -= arrival.distance;
        Some(arrival)
    }

    /// Adds a term to the active set and returns the length by which the direction turns; `None` if the term depends
    /// linearly on the active ones.
    fn enter(&mut self, term: usize, sign: f64) -> Option<f64> {
        if !self.active.enter(term) {
            return None;
        }
        let next = self.active.last_column();
        self.signs.push(sign);
        self.weights.push(0.0);
        // G^-1 s = R^-1 (R^-T s): the new column of R^-1 adds one entry to R^-T s and leaves the others unchanged.
        let entry = vector::dot(next, &self.signs);
        vector::add_scaled(&mut self.weights, entry, next);
        Some(entry)
    }
}

impl<'a> Path<'a> for LeastAngle<'a> {
    fn step(&mut self) -> bool {
        loop {
            let Some(arrival) = self.advance() else { return false };
            self.candidates.close(arrival.term);
            if let Some(turn) = self.enter(arrival.term, arrival.correlation.signum()) {
                self.candidates.turn(arrival.term, &self.weights, turn);
                return true;
            }
        }
    }

    fn active(&self) -> &ActiveSet<'a> {
        &self.active
    }
}
