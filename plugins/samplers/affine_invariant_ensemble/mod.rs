//! `affine_invariant_ensemble`: walkers that move along lines through each other.

mod moves;
mod start;

use lacuna::linalg::Matrix;
use lacuna::math::random::{Stream, permutation, uniform};
use lacuna::plugin::sampler::{Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::study::Complaints;
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use moves::Moves;
use moves::{Move, Others, Settings};

use super::chains;

/// Affine-invariant ensemble: many walkers, each of which moves along the line through itself and
/// another one, by a random stretch.
///
/// It has nothing to tune and no gradient to ask for, and it does not mind how parameters are
/// scaled or correlated: any affine change of the unknowns changes the walkers by the same map and
/// nothing else. It suits up to some twenty unknowns; the autocorrelation time grows faster than their
/// number. Walkers depend on each other, so that their number of effective draws is what counts,
/// and walkers that start far outside the bulk may never find in: start them around the best fit.
///
/// Other `moves` can be mixed in. Jumps by differences between walkers, `{ differential_evolution = 0.8,
/// snooker = 0.2 }`, are the better ones for densities of several modes; the snooker move
/// is the only one that minds how the unknowns are scaled, and takes their spread at the start for a unit.
///
/// References: Goodman and Weare, Comm. App. Math. Comp. Sci. 5 (2010) 65; Foreman-Mackey, Hogg, Lang
/// and Goodman, PASP 125 (2013) 306 (the update by halves); Nelson, Ford and Payne, Astrophys. J. Suppl. 210
/// (2014) 11 (differential evolution within an ensemble).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AffineInvariantEnsemble {
    /// The number of walkers: even, and at least twice the number of unknowns and two more.
    pub walkers: usize,
    /// The number of steps of each walker.
    pub steps: usize,
    /// The weights of the moves, such as `{ stretch = 0.8, differential_evolution = 0.18, snooker = 0.02 }`:
    /// each time a walker moves, one of them is drawn.
    pub moves: Moves,
    /// The scale of the stretch move, called `a` in the literature: a walker's distance from the other one
    /// is multiplied by a number between `1 / stretch` and `stretch`.
    pub stretch: f64,
    /// The number of walkers whose places shape one walk move: at least two.
    pub subset: usize,
    /// The order in which the walkers of one step move.
    pub update: Update,
}

/// The order in which walkers move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Update {
    /// In two halves, drawn anew at each step: each half moves at once, by the places of walkers of the
    /// other half, so that its log densities are computed in parallel.
    Split,
    /// One after the other, by the places where all others then are, as in the paper of 2010.
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
        // Unknowns of discrepancies and effects come on top; `start` counts all of them.
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
                .say("the weights are no shares of the moves")
                .expected("numbers from 0 up, at least one of them above 0")
                .found(format!("{stretch}, {walk}, {jump} and {snooker}"));
        }
    }
}

impl Sampler for AffineInvariantEnsemble {
    fn steps_are_draws(&self) -> bool {
        true
    }

    fn plan(&self, _dimension: usize) -> Plan {
        Plan { chains: self.walkers, steps: self.steps, warm_up: 0, ensemble: true }
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        self.check_start(target.dimension(), &points)?;
        let log_density = chains::log_density(target, &points, "walkers")?;
        // Only the snooker move needs to remember anything.
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

/// Walkers that move at once.
struct Batch<'a> {
    target: &'a dyn Target,
    settings: &'a Settings<'a>,
    shares: &'a [(Move, f64)],
    /// Where they want to go.
    points: Matrix,
    /// The logarithms of the factor beside the ratio of the densities, and of the uniform number that
    /// decides.
    chances: Vec<(f64, f64)>,
}

impl<'a> Batch<'a> {
    fn new(target: &'a dyn Target, settings: &'a Settings<'a>, shares: &'a [(Move, f64)]) -> Self {
        let points = Matrix::zeros(0, target.dimension());
        Self { target, settings, shares, points, chances: Vec::new() }
    }

    /// Moves each of `walkers` by the places of others.
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
            // A log density that is not a number compares false, and the walker stays.
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
