//! Choice of the next term of the path.
//!
//! The path depends on all candidates, but most of them are far from entering. After an evaluation of all of them,
//! their correlations would decrease at known rates if the direction stayed. Each term that enters turns the
//! direction by a known length `t` along one new orthonormal vector, and because columns have length one no
//! correlation can deviate from its straight line by more than `drift = sqrt(sum_i (t_i d_i)^2)`, where `d_i` is the
//! distance since term `i` entered. So only candidates near the level are followed at each step; the others are
//! evaluated again before the drift could have brought one of them there. This is a bound, not an approximation: the
//! path is the same.

use lacuna_linalg::level::{Lines, first_meeting, least_gaps};
use lacuna_linalg::{Matrix, vector};

use super::dictionary::Dictionary;

/// Number of steps within which a candidate could enter, to count as near.
const HORIZON: f64 = 8.0;
/// Allowance of the bound for rounding errors, relative to the level.
const SLACK: f64 = 1e-9;

/// Direction of the path: `sum_i weights[i] * column(active[i])`.
pub(super) struct Direction<'a> {
    pub active: &'a [usize],
    pub weights: &'a [f64],
    /// Common size of the active correlations, which decreases at the rate 1.
    pub level: f64,
}

/// Candidate whose correlation reaches that of the active terms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Arrival {
    pub term: usize,
    /// Distance along the direction.
    pub distance: f64,
    /// Correlation there.
    pub correlation: f64,
}

/// Candidates and their correlations with the residual.
pub(super) struct Candidates<'a> {
    dictionary: &'a Dictionary,
    /// Zero for candidates; infinity for active and dependent columns.
    closed: Vec<f64>,
    /// All correlations at the last evaluation of all candidates, and their rates of decrease there.
    correlations: Vec<f64>,
    rates: Vec<f64>,
    /// Scratch memory of the same length.
    scratch: Vec<f64>,
    since: Since,
    pace: Pace,
    near: Near,
}

/// Changes since the last evaluation of all candidates.
#[derive(Default)]
struct Since {
    /// Change of the fit, by active term.
    shifts: Vec<f64>,
    /// Decrease of the level.
    fallen: f64,
    /// Turns of the direction: their lengths, and the decrease of the level at each.
    turns: Vec<(f64, f64)>,
    /// Smallest distance of a far candidate from the level, along its straight line up to `horizon`.
    clearance: f64,
    horizon: f64,
}

/// Running means of the last steps.
#[derive(Default)]
struct Pace {
    distance: f64,
    turn: f64,
}

/// Candidates near the level, densely packed.
#[derive(Default)]
struct Near {
    terms: Vec<usize>,
    closed: Vec<f64>,
    correlations: Vec<f64>,
    rates: Vec<f64>,
    scratch: Vec<f64>,
    /// Entries of the Gram matrix (`active x near`).
    gram: Matrix,
    /// `0, 1, 2, ...`: all rows of `gram`.
    rows: Vec<usize>,
}

impl<'a> Candidates<'a> {
    /// Returns the candidates at a point of the path from their correlations with the residual there; `closed` is zero
    /// for those that may enter and infinity for the others.
    pub fn new(dictionary: &'a Dictionary, correlations: Vec<f64>, closed: Vec<f64>) -> Self {
        let n = correlations.len();
        Self {
            dictionary,
            closed,
            correlations,
            rates: vec![0.0; n],
            scratch: vec![0.0; n],
            since: Since::default(),
            pace: Pace::default(),
            near: Near::default(),
        }
    }

    /// Returns the candidate with the largest correlation at the start of the path.
    pub fn strongest(&self) -> Option<Arrival> {
        let mut best: Option<Arrival> = None;
        for (term, (&correlation, closed)) in self.correlations.iter().zip(&self.closed).enumerate()
        {
            let least = best.map_or(0.0, |b| b.correlation.abs());
            if *closed == 0.0 && correlation.abs() > least {
                best = Some(Arrival { term, distance: 0.0, correlation });
            }
        }
        best
    }

    /// Moves along the direction until the level meets a candidate; `None` if the level decreases to zero before.
    pub fn advance(&mut self, direction: &Direction<'_>) -> Option<Arrival> {
        if !self.near.terms.is_empty() {
            let (first, distance) = self.near.first(direction.level);
            if self.since.is_safe(distance, direction.level) {
                return self.advance_near(direction, first?, distance);
            }
        }
        self.look_at_all(direction);
        self.choose_near(direction);
        if !self.near.terms.is_empty() {
            let (first, distance) = self.near.first(direction.level);
            if self.since.is_safe(distance, direction.level) {
                return self.advance_near(direction, first?, distance);
            }
            self.near.clear();
        }
        self.advance_all(direction)
    }

    /// Moves with all candidates.
    fn advance_all(&mut self, direction: &Direction<'_>) -> Option<Arrival> {
        let level = direction.level;
        let lines = Lines { values: &self.correlations, rates: &self.rates, closed: &self.closed };
        let (term, distance) = first_meeting(level, lines, &mut self.scratch)
            .filter(|(_, distance)| *distance < level)?;
        self.pace.took(distance);
        vector::add_scaled(&mut self.correlations, -distance, &self.rates);
        Some(Arrival { term, distance, correlation: self.correlations[term] })
    }

    fn advance_near(
        &mut self,
        direction: &Direction<'_>,
        i: usize,
        distance: f64,
    ) -> Option<Arrival> {
        if distance >= direction.level {
            return None;
        }
        let near = &mut self.near;
        vector::add_scaled(&mut near.correlations, -distance, &near.rates);
        self.since.shifts.resize(direction.active.len(), 0.0);
        vector::add_scaled(&mut self.since.shifts, distance, direction.weights);
        self.since.fallen += distance;
        self.pace.took(distance);
        Some(Arrival { term: near.terms[i], distance, correlation: near.correlations[i] })
    }

    /// Updates all correlations and rates to the present point of the path.
    fn look_at_all(&mut self, direction: &Direction<'_>) {
        let Direction { active, weights, .. } = *direction;
        let Self { dictionary, rates, scratch, since, .. } = self;
        if since.fallen > 0.0 {
            since.shifts.resize(active.len(), 0.0);
            dictionary.combine_twice(active, [weights, &since.shifts], [rates, scratch]);
            vector::add_scaled(&mut self.correlations, -1.0, scratch);
        } else {
            dictionary.combine(active, weights, rates);
        }
        self.since = Since::default();
    }

    /// Packs the candidates that could enter soon; none if these are the majority, because packing would not pay.
    fn choose_near(&mut self, direction: &Direction<'_>) {
        let level = direction.level;
        let horizon = (HORIZON * self.pace.distance).min(level);
        // Estimated deviation of the correlations from their straight lines over the horizon.
        let margin = self.pace.turn * self.pace.distance * (HORIZON.powi(3) / 3.0).sqrt();
        self.near.clear();
        let lines = Lines { values: &self.correlations, rates: &self.rates, closed: &self.closed };
        least_gaps(level, horizon, lines, &mut self.scratch);
        let clearance = self.near.choose(&self.scratch, margin);
        if 2 * self.near.terms.len() > self.correlations.len() {
            self.near.clear();
            return;
        }
        self.since = Since { clearance, horizon, ..Since::default() };
        self.near.pack(direction.active, self.dictionary, &self.correlations, &self.rates);
    }

    /// Removes a term from the candidates.
    pub fn close(&mut self, term: usize) {
        self.closed[term] = f64::INFINITY;
        if let Ok(i) = self.near.terms.binary_search(&term) {
            self.near.closed[i] = f64::INFINITY;
        }
    }

    /// Updates the near candidates after a term has become active: the direction has new weights and has turned by
    /// `length`.
    pub fn turn(&mut self, entered: usize, weights: &[f64], length: f64) {
        self.pace.turned(length.abs());
        if self.near.terms.is_empty() {
            return;
        }
        self.since.turns.push((length, self.since.fallen));
        self.near.push(self.dictionary.products(entered));
        let Near { gram, rows, rates, .. } = &mut self.near;
        vector::combine_rows(gram, rows, weights, rates);
    }
}

impl Since {
    /// Returns true if no far candidate can enter before the level has decreased by a further `distance`.
    fn is_safe(&self, distance: f64, level: f64) -> bool {
        let end = self.fallen + distance;
        let squares: f64 =
            self.turns.iter().map(|(length, at)| (length * (end - at)).powi(2)).sum();
        end <= self.horizon && squares.sqrt() + SLACK * level < self.clearance
    }
}

impl Pace {
    fn took(&mut self, distance: f64) {
        self.distance += 0.25 * (distance - self.distance);
    }

    fn turned(&mut self, length: f64) {
        self.turn += 0.25 * (length - self.turn);
    }
}

impl Near {
    fn clear(&mut self) {
        self.terms.clear();
        self.closed.clear();
        self.correlations.clear();
        self.rates.clear();
        self.scratch.clear();
        self.rows.clear();
    }

    /// Selects the terms whose gaps are below the margin; returns the smallest gap of the others.
    fn choose(&mut self, gaps: &[f64], margin: f64) -> f64 {
        let mut clearance = f64::INFINITY;
        let mut count = 0;
        // Written without a branch, which would be unpredictable and slow.
        self.terms.resize(gaps.len(), 0);
        for (term, &gap) in gaps.iter().enumerate() {
            self.terms[count] = term;
            count += usize::from(gap < margin);
            clearance = if gap >= margin && gap < clearance { gap } else { clearance };
        }
        self.terms.truncate(count);
        clearance
    }

    /// Copies the data of the selected terms.
    fn pack(
        &mut self,
        active: &[usize],
        dictionary: &Dictionary,
        correlations: &[f64],
        rates: &[f64],
    ) {
        self.correlations.extend(self.terms.iter().map(|&t| correlations[t]));
        self.rates.extend(self.terms.iter().map(|&t| rates[t]));
        self.closed.resize(self.terms.len(), 0.0);
        self.scratch.resize(self.terms.len(), 0.0);
        self.gram.clear(self.terms.len());
        for &t in active {
            self.push(dictionary.products(t));
        }
    }

    /// Returns the first candidate to arrive and its distance; the level itself if none does.
    fn first(&mut self, level: f64) -> (Option<usize>, f64) {
        let Self { correlations, rates, closed, scratch, .. } = self;
        let lines = Lines { values: correlations, rates, closed };
        let first = first_meeting(level, lines, scratch);
        (first.map(|(i, _)| i), first.map_or(level, |(_, distance)| distance.min(level)))
    }

    /// Adds the row of one active term, restricted to the near columns.
    fn push(&mut self, gram: &[f64]) {
        self.rows.push(self.rows.len());
        self.gram.extend_row(self.terms.iter().map(|&t| gram[t]));
    }
}
