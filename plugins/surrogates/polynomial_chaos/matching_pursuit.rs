//! Orthogonal matching pursuit: the term most correlated with the residual of the least-squares fit enters next
//! (Pati, Rezaiifar and Krishnaprasad 1993).
//!
//! Like the path of least-angle regression it does not depend on the number of runs: the correlations of the residual
//! are updated by the Gram matrix's products with each new orthonormal column (Rubinstein, Zibulevsky and Elad 2008).

use lacuna_linalg::vector;

use super::dictionary::{ActiveSet, Dictionary};
use super::judge::Path;

/// Size of a correlation relative to the largest at the start below which it is a rounding error.
const NOTHING: f64 = 1e-15;

/// State of the pursuit.
pub(super) struct MatchingPursuit<'a> {
    dictionary: &'a Dictionary,
    active: ActiveSet<'a>,
    /// Products of the output with the columns.
    start: Vec<f64>,
    /// Products of the residual with the columns.
    correlations: Vec<f64>,
    scratch: Vec<f64>,
    open: Vec<bool>,
    least: f64,
}

impl<'a> MatchingPursuit<'a> {
    /// Starts the pursuit; `correlations` are the output's products with the dictionary's columns.
    pub fn new(dictionary: &'a Dictionary, correlations: &[f64]) -> Self {
        let largest = correlations.iter().fold(0.0_f64, |most, c| most.max(c.abs()));
        Self {
            dictionary,
            active: ActiveSet::new(dictionary),
            start: correlations.to_vec(),
            correlations: correlations.to_vec(),
            scratch: vec![0.0; correlations.len()],
            open: dictionary.varies().collect(),
            least: NOTHING * largest,
        }
    }

    fn strongest(&self) -> Option<usize> {
        let open = (0..self.open.len()).filter(|&t| self.open[t]);
        let strongest = open.fold(None, |best: Option<usize>, t| {
            let size = |t: usize| self.correlations[t].abs();
            if best.is_none_or(|b| size(t) > size(b)) { Some(t) } else { best }
        })?;
        (self.correlations[strongest].abs() > self.least).then_some(strongest)
    }
}

impl<'a> Path<'a> for MatchingPursuit<'a> {
    fn step(&mut self) -> bool {
        while let Some(term) = self.strongest() {
            self.open[term] = false;
            if !self.active.enter(term) {
                continue;
            }
            let (terms, next) = (self.active.terms(), self.active.last_column());
            let projection: f64 = next.iter().zip(terms).map(|(x, &t)| x * self.start[t]).sum();
            self.dictionary.combine(terms, next, &mut self.scratch);
            vector::add_scaled(&mut self.correlations, -projection, &self.scratch);
            return true;
        }
        false
    }

    fn active(&mut self) -> &mut ActiveSet<'a> {
        &mut self.active
    }
}
