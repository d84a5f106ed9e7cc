//! Moves of a walker, given the positions of the others.
//!
//! Each move leaves the density of one walker invariant as long as the walkers it uses stay fixed, and so does a move
//! drawn with weights that do not depend on the walkers.

use lacuna::math::random::{below, normal, uniform};
use lacuna_linalg::Matrix;
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::samplers::snooker;

/// Probability of a jump by the full difference, which can lead from one mode to another.
const LEAPS: f64 = 0.1;
/// Relative standard deviation of the lengths of the other jumps; it keeps the walkers off a lattice.
const JITTER: f64 = 0.1;

/// Weights of the moves, 0 or more. The move of each walker is drawn at random at each step; moves that are not named
/// have weight 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Moves {
    /// Move along the line through another walker, by a random stretch (Goodman and Weare 2010).
    #[serde(default)]
    pub stretch: f64,
    /// Move by the sum of the deviations of `subset` other walkers from their mean, each times a normal number
    /// (Goodman and Weare 2010, section 2): a random walk with the covariance of the ensemble.
    #[serde(default)]
    pub walk: f64,
    /// Move by `2.38 / sqrt(2 d)` times the difference between two other walkers; one time in ten by the full
    /// difference, which can lead from one mode to another (ter Braak, Statistics and Computing 16 (2006) 239).
    #[serde(default)]
    pub differential_evolution: f64,
    /// Move along the line through another walker, by 1.2 to 2.2 times the difference between two more walkers
    /// projected on that line (ter Braak and Vrugt, Statistics and Computing 18 (2008) 435).
    #[serde(default)]
    pub snooker: f64,
}

impl Default for Moves {
    fn default() -> Self {
        Self { stretch: 1.0, walk: 0.0, differential_evolution: 0.0, snooker: 0.0 }
    }
}

impl Moves {
    /// Returns the weights with their names.
    pub(super) fn weights(&self) -> [(&'static str, f64); 4] {
        [
            ("stretch", self.stretch),
            ("walk", self.walk),
            ("differential_evolution", self.differential_evolution),
            ("snooker", self.snooker),
        ]
    }

    /// Returns true if the weights are finite and non-negative, with at least one above zero.
    pub(super) fn are_sound(&self) -> bool {
        let weights = self.weights();
        weights.iter().all(|(_, w)| *w >= 0.0 && w.is_finite())
            && weights.iter().any(|(_, w)| *w > 0.0)
    }

    /// Returns the moves of non-zero weight with their probabilities.
    pub(super) fn shares(&self) -> Vec<(Move, f64)> {
        let all = [Move::Stretch, Move::Walk, Move::DifferentialEvolution, Move::Snooker];
        let total: f64 = self.weights().iter().map(|(_, weight)| weight).sum();
        let shares = all.into_iter().zip(self.weights());
        shares.filter(|(_, (_, w))| *w > 0.0).map(|(m, (_, w))| (m, w / total)).collect()
    }
}

/// Kind of move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Move {
    Stretch,
    Walk,
    DifferentialEvolution,
    Snooker,
}

impl Move {
    /// Draws a move. With a single move no random number is used.
    pub(super) fn draw(shares: &[(Self, f64)], rng: &mut impl Rng) -> Self {
        let Some(((last, _), rest)) = shares.split_last() else { return Self::Stretch };
        if rest.is_empty() {
            return *last;
        }
        let mut chance = uniform(rng);
        for (kind, share) in rest {
            if chance < *share {
                return *kind;
            }
            chance -= share;
        }
        *last
    }

    /// Returns the name of the move, as in the weights.
    pub(super) fn name(self) -> &'static str {
        Moves::default().weights()[self as usize].0
    }

    /// Returns the number of other walkers that the move needs.
    pub(super) fn needs(self, subset: usize) -> usize {
        match self {
            Self::Stretch => 1,
            Self::Walk => subset,
            Self::DifferentialEvolution => 2,
            Self::Snooker => 3,
        }
    }
}

/// Walkers that stay fixed while one moves.
#[derive(Clone, Copy)]
pub(super) enum Others<'a> {
    /// The walkers with these indices.
    These(&'a [usize]),
    /// All of `count` walkers except `walker`.
    AllBut {
        /// Index of the moving walker.
        walker: usize,
        /// Total number of walkers.
        count: usize,
    },
}

impl Others<'_> {
    fn len(self) -> usize {
        match self {
            Self::These(walkers) => walkers.len(),
            Self::AllBut { count, .. } => count - 1,
        }
    }

    fn at(self, k: usize) -> usize {
        match self {
            Self::These(walkers) => walkers[k],
            Self::AllBut { walker, .. } => k + usize::from(k >= walker),
        }
    }

    /// Draws one of the walkers.
    fn pick(self, rng: &mut impl Rng) -> usize {
        self.at(below(rng, self.len()))
    }

    /// Draws `N` distinct walkers.
    fn pick_distinct<const N: usize>(self, rng: &mut impl Rng) -> [usize; N] {
        let mut picked = [usize::MAX; N];
        for k in 0..N {
            let mut next = self.pick(rng);
            while picked[..k].contains(&next) {
                next = self.pick(rng);
            }
            picked[k] = next;
        }
        picked
    }

    /// Draws `count` distinct walkers.
    fn subset(self, count: usize, rng: &mut impl Rng) -> Vec<usize> {
        let mut picked = Vec::with_capacity(count);
        while picked.len() < count {
            let next = self.pick(rng);
            if !picked.contains(&next) {
                picked.push(next);
            }
        }
        picked
    }
}

/// Settings of the moves.
pub(super) struct Settings<'a> {
    /// Scale `a` of the stretch move.
    pub stretch: f64,
    /// Number of other walkers that define a walk move.
    pub subset: usize,
    /// Unit of length of each coordinate, used in projections.
    pub lengths: &'a [f64],
}

impl Settings<'_> {
    /// Writes the proposed position of `walker` into `new` and returns the logarithm of the factor on the ratio of
    /// the densities. `points` has one row per walker.
    pub(super) fn propose(
        &self,
        kind: Move,
        points: &Matrix,
        walker: usize,
        others: Others<'_>,
        new: &mut [f64],
        rng: &mut impl Rng,
    ) -> f64 {
        let from = points.row(walker);
        match kind {
            Move::Stretch => {
                let through = points.row(others.pick(rng));
                let z = self.draw_stretch(rng);
                for ((new, x), other) in new.iter_mut().zip(from).zip(through) {
                    *new = other + z * (x - other);
                }
                (new.len() as f64 - 1.0) * z.ln()
            }
            Move::Walk => {
                walk(points, from, &others.subset(self.subset, rng), new, rng);
                0.0
            }
            Move::DifferentialEvolution => {
                let [a, b] = others.pick_distinct(rng).map(|k| points.row(k));
                let length = jump_length(new.len(), rng);
                for (((new, x), a), b) in new.iter_mut().zip(from).zip(a).zip(b) {
                    *new = x + length * (a - b);
                }
                0.0
            }
            Move::Snooker => {
                let [anchor, a, b] = others.pick_distinct(rng).map(|k| points.row(k));
                snooker::propose(from, anchor, (a, b), self.lengths, new, rng)
            }
        }
    }

    /// Draws from the density proportional to `1 / sqrt(z)` on `[1 / a, a]` (Foreman-Mackey et al. 2013, equation
    /// 10).
    fn draw_stretch(&self, rng: &mut impl Rng) -> f64 {
        let a = self.stretch;
        ((a - 1.0) * uniform(rng) + 1.0).powi(2) / a
    }
}

/// Returns the factor on the difference by which a walker jumps in `dimension` coordinates.
fn jump_length(dimension: usize, rng: &mut impl Rng) -> f64 {
    if uniform(rng) < LEAPS {
        return 1.0;
    }
    2.38 / (2.0 * dimension as f64).sqrt() * (1.0 + JITTER * normal(rng))
}

/// Writes `x + sum_k z_k (x_k - mean) / sqrt(s)` over the `s` walkers of a subset into `new`; the step has the
/// covariance of the subset.
fn walk(points: &Matrix, from: &[f64], subset: &[usize], new: &mut [f64], rng: &mut impl Rng) {
    let size = subset.len() as f64;
    let mut weights: Vec<f64> = subset.iter().map(|_| normal(rng) / size.sqrt()).collect();
    // Subtracting the mean from the weights gives a combination of the positions themselves, without their mean.
    let mean = weights.iter().sum::<f64>() / size;
    for weight in &mut weights {
        *weight -= mean;
    }
    new.copy_from_slice(from);
    for (&k, weight) in subset.iter().zip(weights) {
        for (new, other) in new.iter_mut().zip(points.row(k)) {
            *new += weight * other;
        }
    }
}
