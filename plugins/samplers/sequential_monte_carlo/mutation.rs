//! Moves of the particles at one temperature.

use lacuna::linalg::Matrix;
use lacuna::math::random::{Stream, below, normal, permutation, uniform};
use lacuna::plugin::Target;
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::{Evaluated, Memory, Mutation, SequentialMonteCarlo, Shape};

/// What is learned about the moves.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Moves {
    /// The size of random walks in units of `2.38 / sqrt(d)`.
    size: f64,
    /// The share of moves taken at the last temperature.
    pub acceptance: f64,
    /// The largest correlation of a coordinate that was left at the last temperature.
    pub correlation: f64,
    /// The correlation of the likelihood that was left there.
    pub of_likelihood: f64,
    /// Sweeps over all particles so far.
    pub sweeps: usize,
}

impl Default for Moves {
    fn default() -> Self {
        Self { size: 1.0, acceptance: 0.0, correlation: 0.0, of_likelihood: 0.0, sweeps: 0 }
    }
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

impl SequentialMonteCarlo {
    /// Moves all particles until they have forgotten where they were; which have moved.
    pub(super) fn mutate(
        &self,
        target: &dyn Target,
        population: &mut Evaluated,
        shape: &Shape,
        memory: &mut Memory,
        stream: &Stream,
    ) -> Vec<bool> {
        let mut moved = vec![false; self.particles];
        let mut watch = Watch::new(population);
        let (mut taken, mut independent) = (0, 1.0);
        let mut sweeps = 0;
        while sweeps < self.moves {
            let mut rng = stream.at(sweeps as u64).generator();
            let kind = match self.mutation {
                Mutation::Automatic if sweeps % 2 == 1 || independent < USEFUL => {
                    Mutation::RandomWalk
                }
                Mutation::Automatic => Mutation::Independent,
                given => given,
            };
            let share = self.sweep(kind, target, population, shape, memory, &mut moved, &mut rng);
            if kind == Mutation::Independent {
                independent = share;
            } else {
                // Robbins and Monro's steps towards the acceptance that suits random walks.
                let size = memory.moves.size * (2.0 * (share - 0.25)).exp();
                memory.moves.size = size.clamp(1e-6, 10.0);
            }
            taken += (share * self.particles as f64).round() as usize;
            sweeps += 1;
            if watch.forgotten(population, self.correlation) {
                break;
            }
        }
        memory.moves.acceptance = taken as f64 / (sweeps * self.particles) as f64;
        memory.moves.sweeps += sweeps;
        (memory.moves.correlation, memory.moves.of_likelihood) = watch.left();
        moved
    }

    /// One move of each particle; the share of those taken.
    fn sweep(
        &self,
        kind: Mutation,
        target: &dyn Target,
        population: &mut Evaluated,
        shape: &Shape,
        memory: &Memory,
        moved: &mut [bool],
        rng: &mut impl Rng,
    ) -> f64 {
        let count = self.particles;
        let halves = match kind {
            Mutation::DifferentialEvolution => {
                let order = permutation(rng, count);
                let (red, blue) = order.split_at(count / 2);
                vec![(red.to_vec(), blue.to_vec()), (blue.to_vec(), red.to_vec())]
            }
            _ => vec![((0..count).collect(), Vec::new())],
        };
        let mut taken = 0;
        for (movers, others) in halves {
            let proposal = match kind {
                Mutation::Independent => independent(population, shape, rng),
                Mutation::DifferentialEvolution => {
                    differences(population, &movers, &others, memory.moves.size, rng)
                }
                _ => random_walk(population, shape, memory.moves.size, rng),
            };
            let proposed = Evaluated::new(target, proposal.points);
            population.evaluations += proposed.evaluations;
            for (row, &particle) in movers.iter().enumerate() {
                let power = memory.temperature;
                let change = proposed.log_prior[row] - population.log_prior[particle]
                    + power * proposed.log_likelihood(row)
                    - power * population.log_likelihood(particle);
                let ln_chance = uniform(rng).ln();
                // A change that is not a number compares false, and the particle stays.
                if ln_chance < change + proposal.ln_ratio[row] {
                    population.replace(particle, &proposed, row);
                    moved[particle] = true;
                    taken += 1;
                }
            }
        }
        taken as f64 / count as f64
    }
}

/// Normal steps with the covariance of the population (Roberts, Gelman and Gilks 1997).
fn random_walk(
    population: &Evaluated,
    shape: &Shape,
    size: f64,
    rng: &mut impl Rng,
) -> Proposal {
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
    others: &[usize],
    size: f64,
    rng: &mut impl Rng,
) -> Proposal {
    let d = population.points.columns();
    let mut points = Matrix::zeros(0, d);
    for &mover in movers {
        let a = below(rng, others.len());
        let b = (a + 1 + below(rng, others.len() - 1)) % others.len();
        let whole = uniform(rng) < 0.1;
        let length =
            if whole { 1.0 } else { size * 2.38 / (2.0 * d as f64).sqrt() * (0.1 * normal(rng)).exp() };
        let (a, b) = (population.points.row(others[a]), population.points.row(others[b]));
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
        let (last, rest) = match self.history.split_last() {
            Some(split) => split,
            None => return false,
        };
        (0..last.len()).all(|q| {
            let stalled = rest.len() >= PATIENCE
                && rest[rest.len() - PATIENCE][q] - last[q] < STALL;
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
