//! Harvest of a nested sampling run: draws, evidence and its error from the removed and the live points.

use lacuna::math::moments::kolmogorov_probability;
use lacuna::math::random::{Stream, permutation, uniform};
use lacuna::plugin::sampler::{Evidence, Harvest, State};
use lacuna::plugin::{Fact, Target};
use lacuna_linalg::Matrix;
use rand::Rng;

use super::volumes::{Ladder, log_sum};
use super::{Memory, Nested};

/// Number of sequences of prior volumes drawn to estimate the error of the evidence.
const SEQUENCES: usize = 100;
/// Draws per effective draw; with this many, drawing in proportion to the weights adds little noise.
const REPEATS: f64 = 4.0;
/// P-value of the ranks below which the draws are not trusted.
const IMPROBABLE: f64 = 1e-3;

impl Nested {
    pub(super) fn bring_home(
        &self,
        target: &dyn Target,
        state: &State,
        memory: &Memory,
        stream: &Stream,
    ) -> Harvest {
        let log_prior = target.log_prior(&state.points);
        let likelihood = |i: usize| state.log_density[i] - log_prior[i];
        let mut living: Vec<usize> = (0..self.live).collect();
        living.sort_by(|&a, &b| likelihood(a).total_cmp(&likelihood(b)));
        let mut rungs = memory.dead.clone();
        rungs.extend(living.iter().map(|&i| likelihood(i)));
        let forgotten = memory.forgotten;
        let ladder = Ladder { forgotten, rungs: &rungs, live: self.live, ended: true };
        let log_weights = ladder.mean_weights();
        let log_evidence = log_sum(&log_weights);
        let weights: Vec<f64> = log_weights.iter().map(|w| (w - log_evidence).exp()).collect();
        let weighted = weights.iter().zip(&rungs).filter(|(w, _)| **w > 0.0);
        let information = weighted.map(|(w, l)| w * l).sum::<f64>() - log_evidence;
        let shrinkage = ladder.scatter(SEQUENCES, &stream.named("volumes"));
        let by_information = (information.max(0.0) / self.live as f64).sqrt();
        let error = shrinkage.max(by_information).hypot(memory.share_variance.sqrt());
        let evidence = Evidence {
            log: log_evidence + memory.log_share,
            error,
            method: format!("nested sampling: {} live points", self.live),
        };
        let ranks = rank_probability(&memory.ranks);
        let (points, log_density) = equal_weights(state, memory, &living, &weights, stream);
        Harvest {
            points,
            log_density,
            effective_size: effective_size(&weights),
            evidence: memory.finished.then_some(evidence),
            doubts: self.doubts(memory, ranks),
            facts: vec![
                Fact::new(
                    "information gained, in nats",
                    format!("{:.2}", information - memory.log_share),
                ),
                Fact::new("dead points", forgotten + memory.dead.len()),
                Fact::new("moves of each point", memory.moves.moves),
                Fact::new(
                    "acceptance of the last moves",
                    format!("{:.3}", memory.moves.acceptance),
                ),
                Fact::new("probability of the ranks of new points", format!("{ranks:.3}")),
            ],
        }
    }

    fn doubts(&self, memory: &Memory, ranks: f64) -> Vec<String> {
        let mut doubts = Vec::new();
        if !memory.finished {
            doubts.push(format!(
                "after {} halvings of the prior volume the live points still contribute to the evidence: the \
                 draws do not cover the peak; raise `halvings`",
                self.halvings
            ));
        }
        if ranks < IMPROBABLE {
            doubts.push(format!(
                "the ranks of new points among the live points are not uniform (probability {ranks:.1e}): \
                 lower `correlation` or raise `moves`"
            ));
        }
        doubts
    }
}

/// Draws with equal weights in random order, and their log densities. `weights` are those of the removed points, then
/// of the live points in the order of `living`.
fn equal_weights(
    state: &State,
    memory: &Memory,
    living: &[usize],
    weights: &[f64],
    stream: &Stream,
) -> (Matrix, Vec<f64>) {
    let mut rng = stream.named("draws").generator();
    let count = (REPEATS * effective_size(weights)).ceil() as usize;
    let places = systematic(weights, count, &mut rng);
    let (d, dead) = (state.points.columns(), memory.dead.len());
    let mut points = Matrix::zeros(0, d);
    let mut log_density = Vec::with_capacity(count);
    for i in permutation(&mut rng, count) {
        if let Some(alive) = places[i].checked_sub(dead) {
            points.push_row(state.points.row(living[alive]));
            log_density.push(state.log_density[living[alive]]);
        } else {
            points.push_row(&memory.points[places[i] * d..(places[i] + 1) * d]);
            log_density.push(memory.log_density[places[i]]);
        }
    }
    (points, log_density)
}

/// Returns the effective number of weighted points, `(sum w)^2 / sum w^2` (Kish 1965).
fn effective_size(weights: &[f64]) -> f64 {
    let sum: f64 = weights.iter().sum();
    sum * sum / weights.iter().map(|w| w * w).sum::<f64>()
}

/// Returns `count` indices in proportion to the weights, by systematic sampling: equally spaced after one random
/// start.
fn systematic(weights: &[f64], count: usize, rng: &mut impl Rng) -> Vec<usize> {
    let sum: f64 = weights.iter().sum();
    let step = sum / count as f64;
    let start = uniform(rng);
    let (mut place, mut reached) = (0, weights[0]);
    (0..count)
        .map(|k| {
            while (k as f64 + start) * step > reached && place + 1 < weights.len() {
                place += 1;
                reached += weights[place];
            }
            place
        })
        .collect()
}

/// Returns the p-value of the Kolmogorov-Smirnov test of uniform ranks. Survivors and new points are two samples of
/// about the same size, hence half the total as the effective size.
fn rank_probability(ranks: &[u64]) -> f64 {
    let total = ranks.iter().sum::<u64>() as f64;
    if total == 0.0 {
        return 1.0;
    }
    let mut sum = 0;
    let distance = ranks.iter().enumerate().map(|(bin, count)| {
        sum += count;
        (sum as f64 / total - (bin + 1) as f64 / ranks.len() as f64).abs()
    });
    kolmogorov_probability(distance.fold(0.0, f64::max), 0.5 * total)
}
