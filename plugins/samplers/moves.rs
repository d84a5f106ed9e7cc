//! Metropolis moves of a population, repeated until it has forgotten where it was.

use lacuna::linalg::Matrix;
use lacuna::math::random::{Stream, below, normal, permutation, uniform};
use lacuna::plugin::Target;
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::evaluated::{Evaluated, Shape};

/// How points move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mutation {
    /// Independent moves as long as they are taken often enough, by turns with differential evolution.
    Automatic,
    /// Normal steps with the covariance of the population, their size adapted to the acceptance.
    RandomWalk,
    /// Draws of Student's t law with the population's mean and covariance.
    Independent,
    /// Steps along the difference of two other points, which follow curved and split populations.
    DifferentialEvolution,
}

/// What is learned about the moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Learned {
    /// The size of random walks and differences, relative to what suits a normal law.
    size: f64,
    /// The share of moves that were taken last.
    pub acceptance: f64,
    /// The largest correlation of a coordinate with that before the last moves.
    pub of_coordinates: f64,
    /// The correlation of the likelihood with that before the last moves.
    pub of_likelihood: f64,
    /// Moves of each point so far.
    pub moves: usize,
}

impl Default for Learned {
    fn default() -> Self {
        Self { size: 1.0, acceptance: 0.0, of_coordinates: 0.0, of_likelihood: 0.0, moves: 0 }
    }
}

/// The law that the moves keep: the log of its density at a point of the second population over
/// that at a point of the first.
pub(super) type Law<'a> = &'a dyn Fn(&Evaluated, usize, &Evaluated, usize) -> f64;

/// What the moves of one population have in common.
pub(super) struct Movement<'a> {
    /// The density.
    pub target: &'a dyn Target,
    /// How points move.
    pub mutation: Mutation,
    /// The correlation below which the past is forgotten.
    pub correlation: f64,
    /// The most moves of each point.
    pub most: usize,
    /// Centre and covariance of the law.
    pub shape: &'a Shape,
    /// The law.
    pub law: Law<'a>,
    /// Draws of the law that stay where they are; without them each half of the population moves
    /// along differences of the other half.
    pub fixed: Option<&'a Matrix>,
}

/// Degrees of freedom of independent draws: tails heavier than those of any likelihood that matters.
const FREEDOM: usize = 5;
/// Independent draws that are taken less often than this are not worth their evaluations.
const USEFUL: f64 = 0.1;
/// A correlation that falls by less than this in [`PATIENCE`] sweeps stays: separate modes do not mix.
const STALL: f64 = 0.02;
const PATIENCE: usize = 8;

/// Proposed points, and the log of the proposal's density at the old point over that at the new.
struct Proposal {
    points: Matrix,
    ln_ratio: Vec<f64>,
}

impl Movement<'_> {
    /// Moves all points until they have forgotten where they were; which have moved.
    pub fn run(
        &self,
        population: &mut Evaluated,
        learned: &mut Learned,
        stream: &Stream,
    ) -> Vec<bool> {
        let count = population.points.rows();
        let mut moved = vec![false; count];
        let mut watch = Watch::new(population);
        let (mut sweeps, mut taken, mut independent) = (0, 0.0, 1.0);
        while sweeps < self.most {
            let mut rng = stream.at(sweeps as u64).generator();
            let kind = match self.mutation {
                Mutation::Automatic if sweeps % 2 == 1 || independent < USEFUL => {
                    Mutation::DifferentialEvolution
                }
                Mutation::Automatic => Mutation::Independent,
                given => given,
            };
            let share = self.sweep(kind, learned.size, population, &mut moved, &mut rng);
            if kind == Mutation::Independent {
                independent = share;
            } else {
                // Robbins and Monro's steps towards the acceptance that suits random walks.
                learned.size = (learned.size * (2.0 * (share - 0.25)).exp()).clamp(1e-6, 10.0);
            }
            taken += share;
            sweeps += 1;
            if watch.forgotten(population, self.correlation) {
                break;
            }
        }
        learned.acceptance = taken / sweeps as f64;
        learned.moves += sweeps;
        (learned.of_coordinates, learned.of_likelihood) = watch.left();
        moved
    }

    /// One move of each point; the share of those taken.
    fn sweep(
        &self,
        kind: Mutation,
        size: f64,
        population: &mut Evaluated,
        moved: &mut [bool],
        rng: &mut impl Rng,
    ) -> f64 {
        let count = population.points.rows();
        let all: Vec<usize> = (0..count).collect();
        let taken = match (kind, self.fixed) {
            (Mutation::DifferentialEvolution, Some(fixed)) => {
                let proposal = differences(population, &all, fixed, size, rng);
                self.decide(population, &all, proposal, moved, rng)
            }
            (Mutation::DifferentialEvolution, None) => {
                let order = permutation(rng, count);
                let (red, blue) = order.split_at(count / 2);
                let mut taken = 0;
                for (movers, others) in [(red, blue), (blue, red)] {
                    let others = population.points.select_rows(others);
                    let proposal = differences(population, movers, &others, size, rng);
                    taken += self.decide(population, movers, proposal, moved, rng);
                }
                taken
            }
            (Mutation::Independent, _) => {
                let proposal = independent(population, self.shape, rng);
                self.decide(population, &all, proposal, moved, rng)
            }
            _ => {
                let proposal = random_walk(population, self.shape, size, rng);
                self.decide(population, &all, proposal, moved, rng)
            }
        };
        taken as f64 / count as f64
    }

    /// Takes or refuses the proposed points, one for each mover; the number of those taken.
    fn decide(
        &self,
        population: &mut Evaluated,
        movers: &[usize],
        proposal: Proposal,
        moved: &mut [bool],
        rng: &mut impl Rng,
    ) -> usize {
        let proposed = Evaluated::new(self.target, proposal.points);
        population.evaluations += proposed.evaluations;
        let mut taken = 0;
        for (row, &mover) in movers.iter().enumerate() {
            let ln_chance = uniform(rng).ln();
            if proposed.log_density[row] == f64::NEG_INFINITY {
                continue;
            }
            if ln_chance < (self.law)(population, mover, &proposed, row) + proposal.ln_ratio[row] {
                population.replace(mover, &proposed, row);
                moved[mover] = true;
                taken += 1;
            }
        }
        taken
    }
}

/// Normal steps with the covariance of the population (Roberts, Gelman and Gilks 1997).
fn random_walk(population: &Evaluated, shape: &Shape, size: f64, rng: &mut impl Rng) -> Proposal {
    let d = shape.centre.len();
    let scale = size * 2.38 / (d as f64).sqrt();
    let step = |point: &[f64]| -> Vec<f64> {
        let z: Vec<f64> = (0..d).map(|_| scale * normal(rng)).collect();
        point.iter().zip(shape.factor.colour(&z)).map(|(x, s)| x + s).collect()
    };
    let points = Matrix::from_rows(d, population.points.iter_rows().map(step));
    Proposal { ln_ratio: vec![0.0; points.rows()], points }
}

/// Draws of Student's t law around the centre of the population.
fn independent(population: &Evaluated, shape: &Shape, rng: &mut impl Rng) -> Proposal {
    let d = shape.centre.len();
    let freedom = FREEDOM as f64;
    let ln_density = |square: f64| -0.5 * (freedom + d as f64) * (square / freedom).ln_1p();
    let mut points = Matrix::zeros(0, d);
    let mut ln_ratio = Vec::with_capacity(population.points.rows());
    for old in population.points.iter_rows() {
        let chi_square: f64 = (0..FREEDOM).map(|_| normal(rng).powi(2)).sum();
        let scale = (freedom / chi_square).sqrt();
        let z: Vec<f64> = (0..d).map(|_| scale * normal(rng)).collect();
        let offset: Vec<f64> = old.iter().zip(&shape.centre).map(|(x, c)| x - c).collect();
        let square: f64 = z.iter().map(|z| z * z).sum();
        ln_ratio.push(ln_density(shape.factor.quadratic(&offset)) - ln_density(square));
        points.extend_row(shape.factor.colour(&z).iter().zip(&shape.centre).map(|(s, c)| c + s));
    }
    Proposal { points, ln_ratio }
}

/// Steps along differences of two other particles (Ter Braak 2006); one in ten is a whole difference, which
/// leads from mode to mode.
fn differences(
    population: &Evaluated,
    movers: &[usize],
    others: &Matrix,
    size: f64,
    rng: &mut impl Rng,
) -> Proposal {
    let d = population.points.columns();
    let mut points = Matrix::zeros(0, d);
    for &mover in movers {
        let a = below(rng, others.rows());
        let b = (a + 1 + below(rng, others.rows() - 1)) % others.rows();
        let whole = uniform(rng) < 0.1;
        let spread = size * 2.38 / (2.0 * d as f64).sqrt() * (0.1 * normal(rng)).exp();
        let length = if whole { 1.0 } else { spread };
        let (a, b) = (others.row(a), others.row(b));
        let from = population.points.row(mover);
        points.extend_row((0..d).map(|j| from[j] + length * (a[j] - b[j])));
    }
    Proposal { ln_ratio: vec![0.0; points.rows()], points }
}

/// How much the particles remember of where they were.
struct Watch {
    before: Vec<Vec<f64>>,
    history: Vec<Vec<f64>>,
}

impl Watch {
    fn new(population: &Evaluated) -> Self {
        Self { before: quantities(population), history: Vec::new() }
    }

    /// Whether each quantity has forgotten its past, or will not within reach.
    fn forgotten(&mut self, population: &Evaluated, threshold: f64) -> bool {
        let now = quantities(population);
        let present: Vec<f64> =
            self.before.iter().zip(&now).map(|(x, y)| correlation(x, y)).collect();
        self.history.push(present);
        let Some((last, rest)) = self.history.split_last() else { return false };
        (0..last.len()).all(|q| {
            let stalled =
                rest.len() >= PATIENCE && rest[rest.len() - PATIENCE][q] - last[q] < STALL;
            last[q] <= threshold || stalled
        })
    }

    /// The correlations that are left: the largest of a coordinate, and that of the likelihood.
    fn left(&self) -> (f64, f64) {
        let last = self.history.last().and_then(|last| last.split_last());
        last.map_or((1.0, 1.0), |(likelihood, coordinates)| {
            (coordinates.iter().copied().fold(0.0, f64::max), *likelihood)
        })
    }
}

/// The coordinates and the likelihood, one list each.
fn quantities(population: &Evaluated) -> Vec<Vec<f64>> {
    let d = population.points.columns();
    let mut all: Vec<Vec<f64>> = (0..d).map(|j| population.points.column(j)).collect();
    all.push(population.log_likelihoods());
    all
}

/// The correlation of two lists; zero where one of them does not vary.
fn correlation(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len() as f64;
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for (a, b) in x.iter().zip(y) {
        let (a, b) = (a - mx, b - my);
        xx += a * a;
        yy += b * b;
        xy += a * b;
    }
    if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 }
}
