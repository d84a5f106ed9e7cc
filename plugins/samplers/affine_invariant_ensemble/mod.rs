//! `affine_invariant_ensemble`: walkers that move along lines through other walkers.

mod moves;
mod start;

use lacuna::math::random::{Stream, permutation, uniform};
use lacuna::plugin::sampler::{Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::chains;
use moves::{Move, Others, Settings};

pub use moves::Moves;

/// Affine-invariant ensemble: many walkers, each of which moves along the line through itself and another walker by a
/// random stretch.
///
/// It needs neither tuning nor gradients and is insensitive to the scales and correlations of the parameters: an
/// affine transformation of the unknowns transforms the walkers alike and changes nothing else. It suits up to about
/// twenty unknowns; the autocorrelation time grows faster than their number. The walkers depend on each other, so
/// judge the run by the number of effective draws. Walkers that start far outside the bulk of the density may never
/// reach it: start them around the best fit.
///
/// Other `moves` can be mixed in. Jumps by differences between walkers,
/// `{ differential_evolution = 0.8, snooker = 0.2 }`, are better for densities with several modes. The snooker move
/// alone depends on the scales of the unknowns: it takes their spread at the start as units.
///
/// References: Goodman and Weare, Comm. App. Math. Comp. Sci. 5 (2010) 65; Foreman-Mackey, Hogg, Lang and Goodman,
/// PASP 125 (2013) 306 (the update by halves); Nelson, Ford and Payne, Astrophys. J. Suppl. 210 (2014) 11
/// (differential evolution within an ensemble).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AffineInvariantEnsemble {
    /// Number of walkers: even, and at least twice the number of parameters plus two. More walkers cost more
    /// evaluations per step and make it easier to cover a complicated density. If the discrepancy and the effects have
    /// unknowns of their own that need more, the number is raised to twice the number of all unknowns plus two.
    pub walkers: usize,
    /// Number of steps. A step moves every walker once and costs one evaluation per walker.
    pub steps: usize,
    /// Weights of the moves, such as `{ stretch = 0.8, differential_evolution = 0.18, snooker = 0.02 }`: each time a
    /// walker moves, one of the moves is drawn with a probability in proportion to its weight.
    pub moves: Moves,
    /// Scale `a` of the stretch move, above 1: the distance to the other walker is multiplied by a random factor
    /// between `1 / a` and `a`. A larger value makes longer moves, which are accepted less often.
    pub stretch: f64,
    /// Number of other walkers that define one walk move, at least 2.
    pub subset: usize,
    /// Order in which the walkers of one step move.
    pub update: Update,
}

/// Order in which the walkers of one step move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Update {
    /// In two halves, which are redrawn at each step. All walkers of one half move at once, relative to walkers of the
    /// other half, so that their log densities are computed in parallel.
    Split,
    /// One after the other, relative to the current positions of all others, as in Goodman and Weare 2010.
    Sequential,
}

impl Default for AffineInvariantEnsemble {
    fn default() -> Self {
        Self {
            walkers: 120,
            steps: 1200,
            moves: Moves::default(),
            stretch: 2.0,
            subset: 3,
            update: Update::Split,
        }
    }
}

impl Component for AffineInvariantEnsemble {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        // Discrepancies and effects add unknowns that are not known here; `start` counts all of them.
        let least = self.least(context.parameters.len());
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
        chains::check_steps(self.steps, 0, complaints);
        if !(self.stretch > 1.0 && self.stretch.is_finite()) {
            complaints
                .at("stretch")
                .say("walkers would not move")
                .expected("a number above 1")
                .found(self.stretch);
        }
        if self.subset < 2 {
            complaints
                .at("subset")
                .say("walkers would not move")
                .expected("at least 2")
                .found(self.subset);
        }
        if !self.moves.are_sound() {
            let [stretch, walk, jump, snooker] = self.moves.weights().map(|(_, weight)| weight);
            complaints
                .at("moves")
                .say("the weights of the moves are not valid")
                .expected("numbers from 0 up, at least one of them above 0")
                .found(format!("{stretch}, {walk}, {jump} and {snooker}"));
        }
    }
}

impl Sampler for AffineInvariantEnsemble {
    fn steps_are_draws(&self) -> bool {
        true
    }

    fn plan(&self, dimension: usize) -> Plan {
        let chains = self.planned(dimension);
        Plan { chains, steps: self.steps, warm_up: 0, ensemble: true }
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        self.check_start(target.dimension(), &points)?;
        let log_density = chains::log_density(target, &points, "walkers")?;
        // Only the snooker move needs a memory.
        let memory = if self.moves.snooker > 0.0 {
            start::lengths(&points).into()
        } else {
            serde_json::Value::Null
        };
        Ok(chains::state(points, log_density, memory))
    }

    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        let mut rng = stream.generator();
        let count = state.points.rows();
        state.accepted.fill(false);
        let lengths = chains::numbers(&state.memory);
        let shares = self.moves.shares();
        let settings = Settings { stretch: self.stretch, subset: self.subset, lengths: &lengths };
        let mut batch = Batch::new(target, &settings, &shares);
        match self.update {
            Update::Split => {
                let order = permutation(&mut rng, count);
                let (red, blue) = order.split_at(count / 2);
                batch.move_walkers(state, red, |_| Others::These(blue), &mut rng);
                batch.move_walkers(state, blue, |_| Others::These(red), &mut rng);
            }
            Update::Sequential => {
                for walker in 0..count {
                    let others = |walker| Others::AllBut { walker, count };
                    batch.move_walkers(state, &[walker], others, &mut rng);
                }
            }
        }
        Ok(())
    }

    fn facts(&self) -> Vec<Fact> {
        let moves = self.moves.shares();
        let named = |(kind, share): &(Move, f64)| format!("{:.0} % {}", 100.0 * share, kind.name());
        let moves = moves.iter().map(named).collect::<Vec<_>>().join(", ");
        vec![
            Fact::new("walkers", self.walkers),
            Fact::new("steps", self.steps),
            Fact::new("moves", moves),
            Fact::new("stretch", self.stretch),
        ]
    }
}

/// Group of walkers that move simultaneously.
struct Batch<'a> {
    target: &'a dyn Target,
    settings: &'a Settings<'a>,
    shares: &'a [(Move, f64)],
    /// Proposed points, one row per walker.
    points: Matrix,
    /// For each walker the logarithms of the factor on the ratio of the densities, and of the uniform number that
    /// decides.
    chances: Vec<(f64, f64)>,
}

impl<'a> Batch<'a> {
    fn new(target: &'a dyn Target, settings: &'a Settings<'a>, shares: &'a [(Move, f64)]) -> Self {
        let points = Matrix::zeros(0, target.dimension());
        Self { target, settings, shares, points, chances: Vec::new() }
    }

    /// Moves each of `walkers` relative to the walkers that `others` names.
    fn move_walkers<'o>(
        &mut self,
        state: &mut State,
        walkers: &[usize],
        others: impl Fn(usize) -> Others<'o>,
        rng: &mut impl Rng,
    ) {
        self.chances.clear();
        if self.points.rows() != walkers.len() {
            self.points = Matrix::zeros(walkers.len(), state.points.columns());
        }
        for (row, &walker) in walkers.iter().enumerate() {
            let kind = Move::draw(self.shares, rng);
            let new = self.points.row_mut(row);
            let ln_factor =
                self.settings.propose(kind, &state.points, walker, others(walker), new, rng);
            self.chances.push((ln_factor, uniform(rng).ln()));
        }
        let log_density = self.target.log_density(&self.points);
        state.evaluations += walkers.len() as u64;
        for (row, (&walker, (ln_factor, ln_chance))) in
            walkers.iter().zip(&self.chances).enumerate()
        {
            // A NaN log density compares false, and the walker stays.
            if *ln_chance < ln_factor + log_density[row] - state.log_density[walker] {
                state.points.row_mut(walker).copy_from_slice(self.points.row(row));
                state.log_density[walker] = log_density[row];
                state.accepted[walker] = true;
            }
        }
    }
}

lacuna::register!(Sampler, "affine_invariant_ensemble", AffineInvariantEnsemble, aliases: ["emcee", "ensemble", "stretch", "mcmc"]);

#[cfg(test)]
mod calibration;
#[cfg(test)]
mod tests;
