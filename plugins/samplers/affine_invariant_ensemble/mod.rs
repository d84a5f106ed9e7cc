//! `affine_invariant_ensemble`: walkers that move along lines through each other.

mod start;

use lacuna::linalg::Matrix;
use lacuna::math::random::{Stream, below, permutation, uniform};
use lacuna::plugin::sampler::{Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::study::Complaints;
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Affine-invariant ensemble: many walkers, each of which moves along the line through itself and
/// another one, by a random stretch.
///
/// It has nothing to tune and no gradient to ask for, and it does not mind how parameters are
/// scaled or correlated: any affine change of the unknowns changes the walkers by the same map and
/// nothing else. It suits up to some twenty unknowns; the autocorrelation time grows faster than their
/// number. Walkers depend on each other, so that their number of effective draws is what counts,
/// and walkers that start far outside the bulk may never find in: start them around the best fit.
///
/// References: Goodman and Weare, Comm. App. Math. Comp. Sci. 5 (2010) 65; Foreman-Mackey, Hogg, Lang
/// and Goodman, PASP 125 (2013) 306 (the update by halves).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AffineInvariantEnsemble {
    /// The number of walkers: even, and at least twice the number of unknowns and two more.
    pub walkers: usize,
    /// The number of steps of each walker.
    pub steps: usize,
    /// The scale of the moves, called `a` in the literature: a walker's distance from the other one is
    /// multiplied by a number between `1 / stretch` and `stretch`.
    pub stretch: f64,
    /// The order in which the walkers of one step move.
    pub update: Update,
}

/// The order in which walkers move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Update {
    /// In two halves, drawn anew at each step: each half moves at once, along lines through walkers
    /// of the other half, so that its log densities are computed in parallel.
    Split,
    /// One after the other, along lines through any walker where it then is, as in the paper of 2010.
    Sequential,
}

impl Default for AffineInvariantEnsemble {
    fn default() -> Self {
        Self { walkers: 120, steps: 1200, stretch: 2.0, update: Update::Split }
    }
}

impl Component for AffineInvariantEnsemble {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        // Unknowns of discrepancies and effects come on top; `start` counts all of them.
        let least = 2 * (context.parameters.len() + 1);
        if self.walkers < least {
            complaints
                .at("walkers")
                .say("too few walkers for the number of parameters")
                .expected(format!("at least {least}"))
                .found(self.walkers);
        } else if !self.walkers.is_multiple_of(2) {
            complaints
                .at("walkers")
                .say("walkers move in two halves")
                .expected("an even number")
                .found(self.walkers);
        }
        if self.steps == 0 {
            complaints.at("steps").say("no steps").expected("at least 1").found(0);
        }
        if !(self.stretch > 1.0 && self.stretch.is_finite()) {
            complaints
                .at("stretch")
                .say("walkers would not move")
                .expected("a number above 1")
                .found(self.stretch);
        }
    }
}

impl Sampler for AffineInvariantEnsemble {
    fn plan(&self, _dimension: usize) -> Plan {
        Plan { chains: self.walkers, steps: self.steps, warm_up: 0, ensemble: true }
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        self.check_start(target.dimension(), &points)?;
        let log_density = target.log_density(&points);
        start::check_support(&log_density)?;
        let count = points.rows();
        Ok(State {
            points,
            log_density,
            accepted: vec![false; count],
            evaluations: count as u64,
            memory: serde_json::Value::Null,
        })
    }

    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        let mut rng = stream.generator();
        let count = state.points.rows();
        state.accepted.fill(false);
        match self.update {
            Update::Split => {
                let order = permutation(&mut rng, count);
                let (red, blue) = order.split_at(count / 2);
                self.move_walkers(target, state, red, blue, &mut rng);
                self.move_walkers(target, state, blue, red, &mut rng);
            }
            Update::Sequential => {
                for walker in 0..count {
                    let others: Vec<usize> = (0..count).filter(|&k| k != walker).collect();
                    self.move_walkers(target, state, &[walker], &others, &mut rng);
                }
            }
        }
        Ok(())
    }

    fn facts(&self) -> Vec<Fact> {
        vec![
            Fact::new("walkers", self.walkers),
            Fact::new("steps", self.steps),
            Fact::new("stretch", self.stretch),
        ]
    }
}

/// Where a walker wants to go.
struct Proposal {
    /// The logarithm of the factor that makes up for the change of volume, `(d - 1) ln z`.
    ln_volume: f64,
    /// The logarithm of the uniform number that decides.
    ln_chance: f64,
}

impl AffineInvariantEnsemble {
    /// Moves each of `walkers` along the line through one of `others` (equation 7 of the paper).
    fn move_walkers(
        &self,
        target: &dyn Target,
        state: &mut State,
        walkers: &[usize],
        others: &[usize],
        rng: &mut impl Rng,
    ) {
        let dimension = state.points.columns();
        let mut points = Matrix::zeros(walkers.len(), dimension);
        let mut proposals = Vec::with_capacity(walkers.len());
        for (row, &walker) in walkers.iter().enumerate() {
            let from = state.points.row(walker);
            let through = state.points.row(others[below(rng, others.len())]);
            let z = self.draw_stretch(rng);
            for ((new, x), other) in points.row_mut(row).iter_mut().zip(from).zip(through) {
                *new = other + z * (x - other);
            }
            proposals.push(Proposal {
                ln_volume: (dimension as f64 - 1.0) * z.ln(),
                ln_chance: uniform(rng).ln(),
            });
        }
        let log_density = target.log_density(&points);
        state.evaluations += walkers.len() as u64;
        for (row, (&walker, proposal)) in walkers.iter().zip(&proposals).enumerate() {
            let ratio = proposal.ln_volume + log_density[row] - state.log_density[walker];
            // A log density that is not a number compares false, and the walker stays.
            if proposal.ln_chance < ratio {
                state.points.row_mut(walker).copy_from_slice(points.row(row));
                state.log_density[walker] = log_density[row];
                state.accepted[walker] = true;
            }
        }
    }

    /// A draw of the density proportional to `1 / sqrt(z)` on `[1 / a, a]` (equation 10).
    fn draw_stretch(&self, rng: &mut impl Rng) -> f64 {
        let a = self.stretch;
        ((a - 1.0) * uniform(rng) + 1.0).powi(2) / a
    }
}

lacuna::register!(Sampler, "affine_invariant_ensemble", AffineInvariantEnsemble);

#[cfg(test)]
mod calibration;
#[cfg(test)]
mod tests;
