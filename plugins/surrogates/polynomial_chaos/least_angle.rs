//! Least-angle regression, with the leave-one-out error of the least-squares fit at every step.
//!
//! The path is that of Efron, Hastie, Johnstone and Tibshirani (2004) on columns with zero mean and unit length; no
//! term ever leaves it. At each step the terms so far are refitted by least squares and assessed by their corrected
//! leave-one-out error ("hybrid" selection: Blatman and Sudret 2011), which is exactly the error of the final model.
//!
//! The speed comes from five things: inner products of the basis functions are shared by all outputs, so that the
//! path does not depend on the number of runs; only candidates that can enter are followed ([`super::candidates`]); the
//! inverse Cholesky factor of the active Gram matrix grows by one column per step; the orthonormal columns needed for
//! leverages and residuals are computed for a block of steps at a time by one matrix product; and the path among more
//! candidates begins with the steps before which none of the further ones reaches the level ([`LeastAngle::among`]).

use std::ops::Range;

use lacuna_linalg::{Matrix, multiply, vector};

use super::candidates::{Arrival, Candidates, Direction};
use super::dictionary::{ActiveSet, Dictionary, Subset};
use super::judge::Path;

/// Allowance for rounding errors, relative to the level, in the comparison of further candidates with it.
const SLACK: f64 = 1e-9;
/// Number of points of a path that are compared first; each further block is twice as long.
const FIRST_BLOCK: usize = 8;

/// State of the path: active terms and direction.
pub(super) struct LeastAngle<'a> {
    dictionary: &'a Dictionary,
    /// Products of the output with the columns.
    start: &'a [f64],
    /// Columns that may enter.
    open: &'a Subset,
    active: ActiveSet<'a>,
    candidates: Candidates<'a>,
    /// Common size of the active correlations.
    level: f64,
    signs: Vec<f64>,
    /// Direction as a combination of the active columns: `G^-1 signs`.
    weights: Vec<f64>,
    /// The present point of the path as a combination of the active columns.
    coefficients: Vec<f64>,
    /// Points at which the level met a candidate, and their coefficients one after the other.
    points: Vec<Point>,
    record: Vec<f64>,
}

/// Point of the path at which the level met a candidate.
struct Point {
    term: usize,
    level: f64,
    /// False if the candidate depends linearly on the active terms.
    entered: bool,
    /// End of its coefficients in the record.
    end: usize,
}

impl<'a> LeastAngle<'a> {
    /// Starts the path; `start` are the output's products with the dictionary's columns.
    pub fn new(dictionary: &'a Dictionary, open: &'a Subset, start: &'a [f64]) -> Self {
        let correlations = start[..open.closed.len()].to_vec();
        Self {
            dictionary,
            start,
            open,
            active: ActiveSet::new(dictionary),
            candidates: Candidates::new(dictionary, correlations, open.closed.clone()),
            level: 0.0,
            signs: Vec::new(),
            weights: Vec::new(),
            coefficients: Vec::new(),
            points: Vec::new(),
            record: Vec::new(),
        }
    }

    /// Returns the path among other candidates, with the steps that it shares with this one.
    pub fn among(mut self, open: &'a Subset) -> Self {
        let shared = self.shared(open);
        let Some(last) = shared.checked_sub(1) else {
            return Self::new(self.dictionary, open, self.start);
        };
        self.points.truncate(shared);
        let count = self.points.iter().filter(|point| point.entered).count();
        self.active.truncate(count);
        self.signs.truncate(count);
        self.weights = self.active.solve_gram(&self.signs);
        self.level = self.points[last].level;
        self.coefficients = self.record[self.range(last)].to_vec();
        self.coefficients.resize(count, 0.0);
        self.record.truncate(self.points[last].end);
        let mut correlations = self.start[..open.closed.len()].to_vec();
        let mut moved = vec![0.0; correlations.len()];
        self.dictionary.combine(self.active.terms(), &self.coefficients, &mut moved);
        vector::add_scaled(&mut correlations, -1.0, &moved);
        let mut closed = open.closed.clone();
        self.points.iter().for_each(|point| closed[point.term] = f64::INFINITY);
        self.candidates = Candidates::new(self.dictionary, correlations, closed);
        self.open = open;
        self
    }

    /// Returns the number of points that this path shares with that among other candidates: up to the first whose term
    /// is not among these, or at which one that is not among this path's reaches the level.
    fn shared(&self, open: &Subset) -> usize {
        let foreign = self.points.iter().position(|point| !open.holds(point.term));
        let end = foreign.unwrap_or(self.points.len());
        let further: Vec<usize> =
            (0..open.closed.len()).filter(|&t| open.holds(t) && !self.open.holds(t)).collect();
        let (mut first, mut length) = (0, FIRST_BLOCK);
        while first < end && !further.is_empty() {
            let block = first..end.min(first + length);
            if let Some(reached) = self.reached(&further, block.clone()) {
                return reached;
            }
            (first, length) = (block.end, 2 * length);
        }
        end
    }

    /// Returns the first of some points at which one of the further candidates reaches the level. Between two points
    /// correlations and level are linear, so that none reaches it there if it does not at their ends.
    fn reached(&self, further: &[usize], mut block: Range<usize>) -> Option<usize> {
        let count = self.range(block.end - 1).len();
        let mut gram = Matrix::zeros(0, further.len());
        for &t in &self.active.terms()[..count] {
            let products = self.dictionary.products(t);
            gram.extend_row(further.iter().map(|&f| products[f]));
        }
        let mut points = Matrix::zeros(block.len(), count);
        for (row, i) in block.clone().enumerate() {
            let own = &self.record[self.range(i)];
            points.row_mut(row)[..own.len()].copy_from_slice(own);
        }
        let first = block.start;
        let moved = multiply(&points, &gram);
        block.find(|&i| {
            let level = self.points[i].level * (1.0 - SLACK);
            let mut pairs = further.iter().zip(moved.row(i - first));
            pairs.any(|(&t, moved)| (self.start[t] - moved).abs() >= level)
        })
    }

    /// Returns the place of a point's coefficients in the record.
    fn range(&self, point: usize) -> Range<usize> {
        let start = point.checked_sub(1).map_or(0, |before| self.points[before].end);
        start..self.points[point].end
    }

    /// Moves along the current direction until a candidate is as correlated as the active terms.
    fn advance(&mut self) -> Option<Arrival> {
        if self.points.is_empty() {
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
        vector::add_scaled(&mut self.coefficients, arrival.distance, &self.weights);
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
        self.coefficients.push(0.0);
        // G^-1 s = R^-1 (R^-T s): the new column of R^-1 adds one entry to R^-T s and leaves the others unchanged.
        let entry = vector::dot(next, &self.signs);
        vector::add_scaled(&mut self.weights, entry, next);
        Some(entry)
    }
}

impl<'a> Path<'a> for LeastAngle<'a> {
    fn step(&mut self) -> bool {
        loop {
            let Some(Arrival { term, correlation, .. }) = self.advance() else { return false };
            self.candidates.close(term);
            self.record.extend(&self.coefficients);
            let (level, end) = (self.level, self.record.len());
            let turn = self.enter(term, correlation.signum());
            self.points.push(Point { term, level, entered: turn.is_some(), end });
            if let Some(turn) = turn {
                self.candidates.turn(term, &self.weights, turn);
                return true;
            }
        }
    }

    fn active(&mut self) -> &mut ActiveSet<'a> {
        &mut self.active
    }
}
