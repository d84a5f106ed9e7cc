//! Trajectories that double until they turn (Betancourt 2017, appendix A.4, in the form of Stan).

use lacuna::linalg::vector::dot;
use lacuna::math::random::uniform;
use lacuna::math::special::ln_sum_exp;
use rand::Rng;

use crate::samplers::hamiltonian::{Flow, LARGEST_ERROR, Phase, Point, Transition};

/// A stretch of a trajectory.
struct Tree {
    /// The momentum at its first point.
    first: Vec<f64>,
    /// The momentum at its last point.
    last: Vec<f64>,
    /// The sum of all momenta.
    total: Vec<f64>,
    /// The logarithm of the sum of all densities, relative to the start's.
    log_weight: f64,
    /// One of its points, drawn by density.
    draw: Point,
    /// The energy of that point with its momentum.
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

    /// This stretch and the one after it, with the draw of one of them; and whether neither the whole
    /// nor either half with the nearest point of the other turns back.
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

/// Whether both ends still move along the way that leads from one to the other.
fn on(first: &[f64], last: &[f64], total: &[f64]) -> bool {
    dot(first, total) > 0.0 && dot(last, total) > 0.0
}

/// Builds trees in one direction.
struct Builder<'a, 'r, R> {
    flow: &'a Flow<'a>,
    energy: f64,
    rng: &'r mut R,
    acceptance: f64,
    gradients: u64,
    divergent: bool,
}

impl<R: Rng> Builder<'_, '_, R> {
    /// A tree of `2^depth` points beyond `phase`, which is left at its last one; `None` where
    /// it turns or diverges.
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

/// One step of a chain.
pub(super) fn transition(
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
        // The new half is favoured, which carries the draw away from the start.
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
