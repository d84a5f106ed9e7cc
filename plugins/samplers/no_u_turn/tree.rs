//! Trajectories that are doubled until they turn back (Betancourt 2017, appendix A.4, in the form of Stan).

use lacuna::math::random::uniform;
use lacuna::math::special::ln_sum_exp;
use lacuna::text::Complaints;
use lacuna_linalg::vector::dot;
use rand::Rng;

use crate::samplers::hamiltonian::{Flow, LARGEST_ERROR, Phase, Point, Transition};

/// A section of a trajectory.
struct Tree {
    /// Momentum at its first point.
    first: Vec<f64>,
    /// Momentum at its last point.
    last: Vec<f64>,
    /// Sum of all momenta.
    total: Vec<f64>,
    /// Log of the sum of the densities `exp(-energy)` of all points, relative to that of the start.
    log_weight: f64,
    /// One of its points, drawn in proportion to the density.
    draw: Point,
    /// Energy of that point with its momentum.
    energy: f64,
}

impl Tree {
    fn leaf(phase: &Phase, log_weight: f64) -> Self {
        Self {
            first: phase.momentum.clone(),
            last: phase.momentum.clone(),
            total: phase.momentum.clone(),
            log_weight,
            draw: phase.point.clone(),
            energy: phase.energy(),
        }
    }

    fn reversed(mut self) -> Self {
        std::mem::swap(&mut self.first, &mut self.last);
        self
    }

    /// Joins two consecutive sections and keeps the draw of one of them. The flag is true if there is no U-turn:
    /// neither over the whole, nor over either half extended by the nearest point of the other.
    fn join(self, next: Self, take_next: bool) -> (Self, bool) {
        let total = sum(&self.total, &next.total);
        let ahead = on(&self.first, &next.last, &total)
            && on(&self.first, &next.first, &sum(&self.total, &next.first))
            && on(&self.last, &next.last, &sum(&next.total, &self.last));
        let joined = Self {
            first: self.first,
            last: next.last,
            total,
            log_weight: ln_sum_exp(self.log_weight, next.log_weight),
            energy: if take_next { next.energy } else { self.energy },
            draw: if take_next { next.draw } else { self.draw },
        };
        (joined, ahead)
    }
}

fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

/// Returns true if both ends still move in the direction that leads from one to the other (Betancourt 2017, appendix
/// A.4.2).
fn on(first: &[f64], last: &[f64], total: &[f64]) -> bool {
    dot(first, total) > 0.0 && dot(last, total) > 0.0
}

/// Builder of the trees in one direction.
struct Builder<'a, 'r, R> {
    flow: &'a Flow<'a>,
    energy: f64,
    rng: &'r mut R,
    acceptance: f64,
    gradients: u64,
    divergent: bool,
}

impl<R: Rng> Builder<'_, '_, R> {
    /// Builds a tree of `2^depth` points beyond `phase`, which moves to its last point; `None` if the trajectory
    /// turns back or diverges.
    fn build(&mut self, phase: &mut Phase, step: f64, depth: u32) -> Option<Tree> {
        if depth == 0 {
            return self.leaf(phase, step);
        }
        let near = self.build(phase, step, depth - 1)?;
        let far = self.build(phase, step, depth - 1)?;
        let chance = (far.log_weight - ln_sum_exp(near.log_weight, far.log_weight)).exp();
        let (tree, ahead) = near.join(far, uniform(self.rng) < chance);
        ahead.then_some(tree)
    }

    fn leaf(&mut self, phase: &mut Phase, step: f64) -> Option<Tree> {
        self.flow.leapfrog(phase, step);
        self.gradients += 1;
        let error = phase.energy() - self.energy;
        if error.is_nan() || error > LARGEST_ERROR {
            self.divergent = true;
            return None;
        }
        self.acceptance += (-error).exp().min(1.0);
        Some(Tree::leaf(phase, -error))
    }
}

/// Reports a depth with which trajectories would have no step, or more than can be made.
pub(crate) fn check_depth(depth: u32, complaints: &mut Complaints<'_>) {
    if !(1..=20).contains(&depth) {
        complaints
            .at("depth")
            .say("trajectories would have no or too many steps")
            .expected("a whole number from 1 to 20")
            .found(depth);
    }
}

/// Makes one step of a chain: a trajectory of at most `2^depth - 1` leapfrog steps of size `step`, and a draw from
/// its points.
pub(crate) fn transition(
    flow: &Flow<'_>,
    from: &Point,
    step: f64,
    depth: u32,
    rng: &mut impl Rng,
) -> Transition {
    let phase = flow.push(from, rng);
    let mut tree = Tree::leaf(&phase, 0.0);
    let energy = phase.energy();
    let (mut backward, mut forward) = (phase.clone(), phase);
    let mut builder =
        Builder { flow, energy, rng, acceptance: 0.0, gradients: 0, divergent: false };
    let (mut ahead, mut doubled) = (true, 0);
    for level in 0..depth {
        let goes_forward = uniform(builder.rng) < 0.5;
        let grown = if goes_forward {
            builder.build(&mut forward, step, level)
        } else {
            builder.build(&mut backward, -step, level)
        };
        ahead = false;
        doubled = level + 1;
        let Some(new) = grown else { break };
        // Biased progressive sampling: the new half is favoured, which carries the draw away from the start.
        let take_new = uniform(builder.rng) < (new.log_weight - tree.log_weight).exp();
        (tree, ahead) = if goes_forward {
            tree.join(new, take_new)
        } else {
            new.reversed().join(tree, !take_new)
        };
        if !ahead {
            break;
        }
    }
    Transition {
        moved: tree.draw.place != from.place,
        point: tree.draw,
        energy: tree.energy,
        depth: Some(doubled),
        acceptance: builder.acceptance / builder.gradients.max(1) as f64,
        gradients: builder.gradients,
        divergent: builder.divergent,
        saturated: ahead,
    }
}
