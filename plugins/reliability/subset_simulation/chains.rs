//! Markov chains of a level: adaptive conditional sampling.

use lacuna::math::random::{Stream, normal, permutation, uniform};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use super::levels::{Level, Simulated};

/// Scale of the moves, which is adapted from chain to chain (Papaioannou, Betz, Zwirglmaier and Straub, Probabilistic
/// Engineering Mechanics 41 (2015) 89).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moves {
    scale: f64,
}

/// Acceptance rate that the scale is adapted to, and the share of the chains between two adaptations.
const RATE: f64 = 0.44;
const BATCHES: usize = 10;

impl Moves {
    /// The scale of the first level.
    pub fn new() -> Self {
        Self { scale: 0.6 }
    }
}

/// Samples of a level, chain after chain.
pub struct Grown {
    pub points: Matrix,
    pub values: Vec<f64>,
    pub chains: Vec<usize>,
}

/// State of a chain.
struct Chain {
    point: Vec<f64>,
    value: f64,
    log_weight: f64,
}

/// Grows chains from the samples of a level that are not above its threshold, until there are `count` samples.
///
/// A candidate is `rho u + sqrt(1 - rho^2) z`, which leaves the standard normal distribution unchanged; it is accepted
/// if it is not above the threshold, with the ratio of the weights as a further condition.
pub fn grow(
    problem: &Simulated<'_>,
    level: &Level,
    count: usize,
    moves: &mut Moves,
    stream: &Stream,
) -> Result<Grown, Stop> {
    let mut seeds: Vec<usize> =
        (0..level.values.len()).filter(|i| level.values[*i] <= level.threshold).collect();
    let order = permutation(&mut stream.named("order").generator(), seeds.len());
    seeds = order.into_iter().map(|i| seeds[i]).collect();
    let spread = deviations(level, &seeds);
    let lengths: Vec<usize> = (0..seeds.len())
        .map(|i| count / seeds.len() + usize::from(i < count % seeds.len()))
        .collect();
    let start = level.points.select_rows(&seeds);
    let weights = problem.log_weights.map_or_else(|| vec![0.0; seeds.len()], |w| w(&start));
    let mut grown = Grown {
        points: Matrix::zeros(0, level.points.columns()),
        values: Vec::new(),
        chains: Vec::new(),
    };
    let together = seeds.len().div_ceil(BATCHES);
    let mut rng = stream.named("moves").generator();
    for (batch, first) in (0..seeds.len()).step_by(together).enumerate() {
        let members: Vec<usize> = (first..seeds.len().min(first + together)).collect();
        let mut states: Vec<Chain> = members
            .iter()
            .map(|&i| Chain {
                point: start.row(i).to_vec(),
                value: level.values[seeds[i]],
                log_weight: weights[i],
            })
            .collect();
        let mut history: Vec<Vec<(Vec<f64>, f64)>> =
            states.iter().map(|s| vec![(s.point.clone(), s.value)]).collect();
        let sizes: Vec<f64> = spread.iter().map(|s| (moves.scale * s).min(1.0)).collect();
        let (mut accepted, mut tried) = (0_usize, 0_usize);
        for step in 1..lengths.iter().copied().max().unwrap_or(1) {
            let moving: Vec<usize> =
                (0..members.len()).filter(|&k| lengths[members[k]] > step).collect();
            if moving.is_empty() {
                break;
            }
            let candidates = Matrix::from_rows(
                problem.dimension,
                moving.iter().map(|&k| {
                    let pairs = states[k].point.iter().zip(&sizes);
                    pairs
                        .map(|(u, s)| (1.0 - s * s).sqrt() * u + s * normal(&mut rng))
                        .collect::<Vec<f64>>()
                }),
            );
            let values = (problem.values)(&candidates)?;
            let log_weights =
                problem.log_weights.map_or_else(|| vec![0.0; moving.len()], |w| w(&candidates));
            for (i, &k) in moving.iter().enumerate() {
                let chance = uniform(&mut rng).ln();
                let heavy =
                    problem.log_weights.is_none() || chance < log_weights[i] - states[k].log_weight;
                if values[i] <= level.threshold && heavy {
                    let point = candidates.row(i).to_vec();
                    states[k] = Chain { point, value: values[i], log_weight: log_weights[i] };
                    accepted += 1;
                }
                tried += 1;
                history[k].push((states[k].point.clone(), states[k].value));
            }
        }
        for chain in history {
            grown.chains.push(chain.len());
            for (point, value) in chain {
                grown.points.push_row(&point);
                grown.values.push(value);
            }
        }
        if tried > 0 {
            let rate = accepted as f64 / tried as f64;
            moves.scale *= ((rate - RATE) / (batch as f64 + 1.0).sqrt()).exp();
            moves.scale = moves.scale.clamp(1e-3, 1e3);
        }
    }
    Ok(grown)
}

/// Standard deviation of each variable among the seeds, at most one.
fn deviations(level: &Level, seeds: &[usize]) -> Vec<f64> {
    let n = seeds.len() as f64;
    let one = |j: usize| {
        let mean = seeds.iter().map(|&i| level.points[(i, j)]).sum::<f64>() / n;
        let square: f64 = seeds.iter().map(|&i| (level.points[(i, j)] - mean).powi(2)).sum();
        let deviation = (square / (n - 1.0)).sqrt();
        if deviation > 0.0 { deviation } else { 1.0 }
    };
    (0..level.points.columns()).map(one).collect()
}

/// The factor `gamma` by which the correlation within chains raises the variance of the share of samples that are `below`
/// (Au and Beck, Probabilistic Engineering Mechanics 16 (2001) 263, equations 27 to 29).
pub fn correlation(below: &[bool], chains: &[usize], share: f64) -> f64 {
    let longest = chains.iter().copied().max().unwrap_or(0);
    if longest < 2 || share <= 0.0 || share >= 1.0 {
        return 0.0;
    }
    let total = below.len() as f64;
    let mut gamma = 0.0;
    for lag in 1..longest {
        let (mut sum, mut pairs, mut first) = (0_usize, 0_usize, 0);
        for length in chains {
            for i in first..(first + length).saturating_sub(lag) {
                sum += usize::from(below[i] && below[i + lag]);
                pairs += 1;
            }
            first += length;
        }
        if pairs > 0 {
            let covariance = sum as f64 / pairs as f64 - share * share;
            gamma += 2.0 * pairs as f64 / total * covariance / (share * (1.0 - share));
        }
    }
    gamma.max(0.0)
}
