//! The moves of a walker, given where the others stand.
//!
//! Each move leaves the density of one walker unchanged as long as the walkers it looks at stand
//! still, and so does a move drawn by weights that do not depend on the walkers.

use lacuna::linalg::Matrix;
use lacuna::math::random::{below, normal, uniform};
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::samplers::snooker;

/// How often a jump has the whole length of the difference, which leads from one mode to another.
const LEAPS: f64 = 0.1;
/// The relative spread of the lengths of the other jumps, which keeps them off a lattice.
const JITTER: f64 = 0.1;

/// The weights of the moves. Each move of a walker is drawn anew; those that are not named have
/// weight zero.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Moves {
    /// Along the line through another walker, by a random stretch (Goodman and Weare 2010).
    #[serde(default)]
    pub stretch: f64,
    /// By a normal number times the deviation of each of `subset` other walkers from their mean
    /// (Goodman and Weare 2010, section 2): a random walk that has the shape of the ensemble.
    #[serde(default)]
    pub walk: f64,
    /// By `2.38 / sqrt(2 d)` times the difference between two other walkers, one time in ten by the
    /// whole difference, which leads from one mode to another (ter Braak, Statistics and Computing 16
    /// (2006) 239).
    #[serde(default)]
    pub differential_evolution: f64,
    /// Along the line through another walker, by 1.2 to 2.2 times the difference between two more,
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
    /// The weights with their names.
    pub(super) fn weights(&self) -> [(&'static str, f64); 4] {
        [
            ("stretch", self.stretch),
            ("walk", self.walk),
            ("differential_evolution", self.differential_evolution),
            ("snooker", self.snooker),
        ]
    }

    /// Whether the weights are shares of something.
    pub(super) fn are_sound(&self) -> bool {
        let weights = self.weights();
        weights.iter().all(|(_, w)| *w >= 0.0 && w.is_finite())
            && weights.iter().any(|(_, w)| *w > 0.0)
    }

    /// The moves that have a weight, with their share.
    pub(super) fn shares(&self) -> Vec<(Move, f64)> {
        let all = [Move::Stretch, Move::Walk, Move::DifferentialEvolution, Move::Snooker];
        let total: f64 = self.weights().iter().map(|(_, weight)| weight).sum();
        let shares = all.into_iter().zip(self.weights());
        shares.filter(|(_, (_, w))| *w > 0.0).map(|(m, (_, w))| (m, w / total)).collect()
    }
}

/// One kind of move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Move {
    Stretch,
    Walk,
    DifferentialEvolution,
    Snooker,
}

impl Move {
    /// Draws a move; nothing is drawn where there is no choice.
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

    /// Its name, as in the weights.
    pub(super) fn name(self) -> &'static str {
        Moves::default().weights()[self as usize].0
    }

    /// How many other walkers it needs.
    pub(super) fn needs(self, subset: usize) -> usize {
        match self {
            Self::Stretch => 1,
            Self::Walk => subset,
            Self::DifferentialEvolution => 2,
            Self::Snooker => 3,
        }
    }
}

/// The walkers that stand still while one moves.
#[derive(Clone, Copy)]
pub(super) enum Others<'a> {
    /// These.
    These(&'a [usize]),
    /// All of `count` but `walker`.
    AllBut {
        /// The one that moves.
        walker: usize,
        /// The number of all.
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

    /// One of them.
    fn pick(self, rng: &mut impl Rng) -> usize {
        self.at(below(rng, self.len()))
    }

    /// Some of them, all different.
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

    /// `count` of them, all different.
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

/// What the moves depend on besides the walkers.
pub(super) struct Settings<'a> {
    /// The scale `a` of the stretch.
    pub stretch: f64,
    /// The number of walkers that a walk looks at.
    pub subset: usize,
    /// The unit of length of each coordinate, in which projections are made.
    pub lengths: &'a [f64],
}

impl Settings<'_> {
    /// Writes the place to which `walker` would go into `new` and gives the logarithm of the factor
    /// that belongs to the ratio of the densities.
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

    /// A draw of the density proportional to `1 / sqrt(z)` on `[1 / a, a]` (equation 10 of the paper of
    /// 2013).
    fn draw_stretch(&self, rng: &mut impl Rng) -> f64 {
        let a = self.stretch;
        ((a - 1.0) * uniform(rng) + 1.0).powi(2) / a
    }
}

/// The factor of a difference by which a walker jumps in `dimension` coordinates.
fn jump_length(dimension: usize, rng: &mut impl Rng) -> f64 {
    if uniform(rng) < LEAPS {
        return 1.0;
    }
    2.38 / (2.0 * dimension as f64).sqrt() * (1.0 + JITTER * normal(rng))
}

/// `x + sum_k z_k (x_k - mean) / sqrt(s)` over the `s` walkers of a subset, which has their covariance.
fn walk(points: &Matrix, from: &[f64], subset: &[usize], new: &mut [f64], rng: &mut impl Rng) {
    let size = subset.len() as f64;
    let mut weights: Vec<f64> = subset.iter().map(|_| normal(rng) / size.sqrt()).collect();
    // The mean's share taken off each weight leaves a combination of the places themselves.
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
