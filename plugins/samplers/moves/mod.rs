//! Metropolis moves of a population, repeated until it has forgotten its start.

mod levels;
mod rescaling;
mod watch;

use lacuna::math::random::{Stream, normal, permutation, uniform};
use lacuna::plugin::Target;
use lacuna_linalg::Matrix;
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::evaluated::{Evaluated, Shape};
use levels::Levels;
use watch::Watch;

/// Kind of the moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mutation {
    /// In turn: independent draws, differential evolution, and changes of scale between points of low and of high
    /// likelihood, which lead into the neck of a funnel. The first and the last are dropped if fewer than 10 % of
    /// them are accepted.
    Automatic,
    /// Normal steps with the covariance of the population and a size tuned to the acceptance rate. For densities that
    /// are nearly normal.
    RandomWalk,
    /// Independent draws from Student's t distribution with the population's mean and covariance. For densities that
    /// are nearly normal, with few unknowns.
    Independent,
    /// Steps along the difference of two other points of similar likelihood. For curved densities and several modes.
    DifferentialEvolution,
}

/// Kind of one move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    RandomWalk,
    Independent,
    DifferentialEvolution,
    /// Maps between groups of points of similar likelihood.
    Rescaling,
}

/// Tuning of the moves, and statistics of the last ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Learned {
    /// Size of random walks and differences, relative to the optimum of a normal density.
    size: f64,
    /// Acceptance rate of the last moves.
    pub acceptance: f64,
    /// Largest correlation of a coordinate with its value before the last moves.
    pub of_coordinates: f64,
    /// Rank correlation of the likelihood with that before the last moves.
    pub of_likelihood: f64,
    /// Number of moves of each point so far.
    pub moves: usize,
    /// Number of moves after which the next population is expected to have forgotten its start.
    planned: usize,
}

impl Default for Learned {
    fn default() -> Self {
        Self {
            size: 1.0,
            acceptance: 0.0,
            of_coordinates: 0.0,
            of_likelihood: 0.0,
            moves: 0,
            planned: FIRST_PLAN,
        }
    }
}

/// Target distribution of the moves: the log of its density at a point of the second population minus that at a point
/// of the first.
pub(super) type Law<'a> = &'a dyn Fn(&Evaluated, usize, &Evaluated, usize) -> f64;

/// Points from which the proposals are built.
#[derive(Clone, Copy)]
pub(super) enum Others<'a> {
    /// Each half of the population from the other half, with the mean and covariance of all.
    OtherHalf(&'a Shape),
    /// Fixed draws that do not move.
    Apart(&'a [Side]),
}

/// Indices of the moving points, and fixed draws of the target distribution from which their proposals are built.
///
/// The moving points started from other draws: a copy whose proposals use its own original would be drawn towards the
/// rest.
pub(super) struct Side {
    pub movers: Vec<usize>,
    pub others: Evaluated,
    pub shape: Shape,
}

/// Moving points, and the points from which their proposals are built.
#[derive(Clone, Copy)]
struct Group<'a> {
    movers: &'a [usize],
    others: &'a Evaluated,
    shape: &'a Shape,
}

/// Settings common to all moves of one population.
pub(super) struct Movement<'a> {
    /// The posterior.
    pub target: &'a dyn Target,
    /// Kind of the moves.
    pub mutation: Mutation,
    /// Correlation with the start below which the start counts as forgotten.
    pub correlation: f64,
    /// Maximum number of moves of each point.
    pub most: usize,
    /// Target distribution of the moves.
    pub law: Law<'a>,
    /// Points from which the proposals are built.
    pub others: Others<'a>,
    /// If true, size and number of moves are fixed before the population moves, from the populations before it. This
    /// matters if many small errors add up: stopping when the own outcome looks right would select outcomes.
    pub ahead: bool,
}

/// Degrees of freedom of the independent draws; their tails are heavier than those of any relevant likelihood.
const FREEDOM: usize = 5;
/// Acceptance rate below which independent draws and rescalings are not worth their evaluations.
const USEFUL: f64 = 0.1;
/// Number of moves of the first population if the number is fixed ahead.
const FIRST_PLAN: usize = 20;

/// Points that a move proposes.
struct Proposal {
    points: Matrix,
    /// Log of the proposal's density at the old point minus that at the new point, without the choice of a group.
    ln_ratio: Vec<f64>,
    /// Groups of points from which steps are taken, and the group chosen for each point.
    chosen: Option<(Levels, Vec<usize>)>,
}

impl Proposal {
    /// Returns the log of the probability of the reverse proposal minus that of the proposal; `from` and `to` are the
    /// log-likelihoods of the old and the new point.
    fn ln_back(&self, row: usize, from: f64, to: f64) -> f64 {
        let choice = self.chosen.as_ref().map_or(0.0, |(levels, chosen)| {
            levels.ln_chance(chosen[row], to) - levels.ln_chance(chosen[row], from)
        });
        self.ln_ratio[row] + choice
    }
}

impl Movement<'_> {
    /// Moves all points until they have forgotten their start; returns a flag per point that is true if it has moved.
    pub fn run(
        &self,
        population: &mut Evaluated,
        learned: &mut Learned,
        stream: &Stream,
    ) -> Vec<bool> {
        let count = population.points.rows();
        let mut moved = vec![false; count];
        let mut watch = Watch::new(population);
        let (mut sweeps, mut taken) = (0, 0.0);
        let mut turns = Turns::default();
        let mut size = learned.size;
        let mut forgotten = None;
        let most = if self.ahead { learned.planned.min(self.most) } else { self.most };
        while sweeps < most && (self.ahead || forgotten.is_none()) {
            let mut rng = stream.at(sweeps as u64).generator();
            let kind = match self.mutation {
                Mutation::Automatic => turns.next(),
                Mutation::RandomWalk => Kind::RandomWalk,
                Mutation::Independent => Kind::Independent,
                Mutation::DifferentialEvolution => Kind::DifferentialEvolution,
            };
            let now = if self.ahead { learned.size } else { size };
            let share = self.sweep(kind, now, population, &mut moved, &mut rng);
            turns.learn(kind, share);
            if matches!(kind, Kind::DifferentialEvolution | Kind::RandomWalk) {
                // Robbins-Monro recursion towards the optimal acceptance rate of random walks.
                let gain = if self.ahead { 1.0 / most as f64 } else { 2.0 };
                size = (size * (gain * (share - 0.25)).exp()).clamp(1e-6, 10.0);
            }
            taken += share;
            sweeps += 1;
            if watch.forgotten(population, self.correlation) {
                forgotten = forgotten.or(Some(sweeps));
            }
        }
        learned.size = size;
        learned.planned = plan(most, forgotten);
        learned.acceptance = taken / sweeps as f64;
        learned.moves += sweeps;
        (learned.of_coordinates, learned.of_likelihood) = watch.left();
        moved
    }

    /// Proposes one move of each point; returns the acceptance rate.
    fn sweep(
        &self,
        kind: Kind,
        size: f64,
        population: &mut Evaluated,
        moved: &mut [bool],
        rng: &mut impl Rng,
    ) -> f64 {
        let count = population.points.rows();
        let mut taken = 0;
        match self.others {
            Others::OtherHalf(shape) => {
                let order = permutation(rng, count);
                let (red, blue) = order.split_at(count / 2);
                for (movers, others) in [(red, blue), (blue, red)] {
                    let others = &population.select(others);
                    let group = Group { movers, others, shape };
                    taken += self.learn_and_move(kind, size, group, population, moved, rng);
                }
            }
            Others::Apart(sides) => {
                for Side { movers, others, shape } in sides {
                    let group = Group { movers, others, shape };
                    taken += self.learn_and_move(kind, size, group, population, moved, rng);
                }
            }
        }
        taken as f64 / count as f64
    }

    /// Proposes one move of each point of a group; returns the number accepted.
    fn learn_and_move(
        &self,
        kind: Kind,
        size: f64,
        group: Group<'_>,
        population: &mut Evaluated,
        moved: &mut [bool],
        rng: &mut impl Rng,
    ) -> usize {
        let proposal = match kind {
            Kind::Independent => Some(independent(population, group, rng)),
            Kind::RandomWalk => Some(random_walk(population, group, size, rng)),
            Kind::DifferentialEvolution => Some(differences(population, group, size, rng)),
            Kind::Rescaling => rescaling::rescalings(population, group, rng),
        };
        proposal.map_or(0, |proposal| self.decide(population, group.movers, proposal, moved, rng))
    }

    /// Accepts or rejects the proposed points, one per mover; returns the number accepted.
    fn decide(
        &self,
        population: &mut Evaluated,
        movers: &[usize],
        mut proposal: Proposal,
        moved: &mut [bool],
        rng: &mut impl Rng,
    ) -> usize {
        let proposed = Evaluated::new(self.target, std::mem::take(&mut proposal.points));
        population.evaluations += proposed.evaluations;
        let mut taken = 0;
        for (row, &mover) in movers.iter().enumerate() {
            let ln_chance = uniform(rng).ln();
            if proposed.log_density[row] == f64::NEG_INFINITY {
                continue;
            }
            let (from, to) = (population.log_likelihood(mover), proposed.log_likelihood(row));
            let back = proposal.ln_back(row, from, to);
            if ln_chance < (self.law)(population, mover, &proposed, row) + back {
                population.replace(mover, &proposed, row);
                moved[mover] = true;
                taken += 1;
            }
        }
        taken
    }
}

/// Plans the number of moves of the next population from that of the last one and the number after which the last one
/// had forgotten its start (`None` if it had not).
fn plan(moves: usize, forgotten: Option<usize>) -> usize {
    match forgotten {
        Some(needed) => moves - (moves - needed) / 10,
        None => moves + moves / 5 + 1,
    }
}

/// Sequence of the kinds of moves that take turns.
struct Turns {
    last: usize,
    useful: [bool; 3],
}

const KINDS: [Kind; 3] = [Kind::Independent, Kind::DifferentialEvolution, Kind::Rescaling];

impl Default for Turns {
    fn default() -> Self {
        Self { last: KINDS.len() - 1, useful: [true; 3] }
    }
}

impl Turns {
    fn next(&mut self) -> Kind {
        loop {
            self.last = (self.last + 1) % KINDS.len();
            if self.useful[self.last] {
                return KINDS[self.last];
            }
        }
    }

    fn learn(&mut self, kind: Kind, share: f64) {
        if let Some(place) = KINDS.iter().position(|k| *k == kind) {
            self.useful[place] = share >= USEFUL || kind == Kind::DifferentialEvolution;
        }
    }
}

/// Proposes normal steps with the covariance of the population (Roberts, Gelman and Gilks 1997).
fn random_walk(
    population: &Evaluated,
    Group { movers, shape, .. }: Group<'_>,
    size: f64,
    rng: &mut impl Rng,
) -> Proposal {
    let d = shape.centre.len();
    let scale = size * 2.38 / (d as f64).sqrt();
    let mut step = |point: &[f64]| -> Vec<f64> {
        let z: Vec<f64> = (0..d).map(|_| scale * normal(rng)).collect();
        point.iter().zip(shape.factor.colour(&z)).map(|(x, s)| x + s).collect()
    };
    let points = Matrix::from_rows(d, movers.iter().map(|&i| step(population.points.row(i))));
    Proposal { ln_ratio: vec![0.0; points.rows()], points, chosen: None }
}

/// Proposes draws from Student's t distribution around the mean of the population.
fn independent(
    population: &Evaluated,
    Group { movers, shape, .. }: Group<'_>,
    rng: &mut impl Rng,
) -> Proposal {
    let d = shape.centre.len();
    let freedom = FREEDOM as f64;
    let ln_density = |square: f64| -0.5 * (freedom + d as f64) * (square / freedom).ln_1p();
    let mut points = Matrix::zeros(0, d);
    let mut ln_ratio = Vec::with_capacity(movers.len());
    for old in movers.iter().map(|&i| population.points.row(i)) {
        let chi_square: f64 = (0..FREEDOM).map(|_| normal(rng).powi(2)).sum();
        let scale = (freedom / chi_square).sqrt();
        let z: Vec<f64> = (0..d).map(|_| scale * normal(rng)).collect();
        let offset: Vec<f64> = old.iter().zip(&shape.centre).map(|(x, c)| x - c).collect();
        let square: f64 = z.iter().map(|z| z * z).sum();
        ln_ratio.push(ln_density(shape.factor.quadratic(&offset)) - ln_density(square));
        points.extend_row(shape.factor.colour(&z).iter().zip(&shape.centre).map(|(s, c)| c + s));
    }
    Proposal { points, ln_ratio, chosen: None }
}

/// Proposes steps along the difference of two other points of similar likelihood (ter Braak 2006); one step in ten is
/// the full difference of any two points, which can lead from mode to mode.
fn differences(
    population: &Evaluated,
    Group { movers, others, .. }: Group<'_>,
    size: f64,
    rng: &mut impl Rng,
) -> Proposal {
    let d = population.points.columns();
    let levels = Levels::of(others);
    let mut points = Matrix::zeros(0, d);
    let mut chosen = Vec::with_capacity(movers.len());
    for &mover in movers {
        let whole = uniform(rng) < 0.1;
        let spread = size * 2.38 / (2.0 * d as f64).sqrt() * (0.1 * normal(rng)).exp();
        let length = if whole { 1.0 } else { spread };
        let level = levels.choose(population.log_likelihood(mover), rng);
        let members = if whole { levels.all() } else { levels.members(level) };
        let (a, b) = levels::pair(members.len(), rng);
        let (a, b) = (others.points.row(members[a]), others.points.row(members[b]));
        let from = population.points.row(mover);
        points.extend_row((0..d).map(|j| from[j] + length * (a[j] - b[j])));
        chosen.push(level);
    }
    Proposal { ln_ratio: vec![0.0; points.rows()], points, chosen: Some((levels, chosen)) }
}
