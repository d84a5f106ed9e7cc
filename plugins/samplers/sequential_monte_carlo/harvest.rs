//! Harvest of sequential Monte Carlo: draws, evidence and its error.

use lacuna::math::random::{Stream, permutation};
use lacuna::plugin::sampler::{Evidence, Harvest, State};
use lacuna::plugin::{Fact, Target};

use super::genealogy::{effective_families, effective_size, evidence_variance};
use super::{Memory, SequentialMonteCarlo};

/// Number of families below which the error of the evidence is itself uncertain by half its size.
const FAMILIES: f64 = 8.0;

impl SequentialMonteCarlo {
    pub(super) fn bring_home(
        &self,
        target: &dyn Target,
        state: &State,
        memory: &Memory,
        stream: &Stream,
    ) -> Harvest {
        let order = permutation(&mut stream.generator(), self.particles);
        let log_prior = target.log_prior(&state.points);
        let mean_likelihood =
            state.log_density.iter().zip(&log_prior).map(|(d, p)| d - p).sum::<f64>()
                / self.particles as f64;
        let families = effective_families(&memory.families);
        let evidence = Evidence {
            log: memory.log_evidence,
            error: evidence_error(memory),
            method: format!(
                "sequential Monte Carlo: {} particles, {} temperatures",
                self.particles, memory.generations
            ),
        };
        let information = mean_likelihood - evidence.log;
        let finished = memory.temperature == 1.0;
        Harvest {
            points: state.points.select_rows(&order),
            log_density: order.iter().map(|&i| state.log_density[i]).collect(),
            effective_size: worth(state, memory),
            evidence: finished.then_some(evidence),
            doubts: self.doubts(state, memory, families),
            facts: vec![
                Fact::new("temperatures", memory.generations),
                Fact::new("moves of each particle", memory.moves.moves),
                Fact::new(
                    "acceptance at the last temperature",
                    format!("{:.3}", memory.moves.acceptance),
                ),
                Fact::new(
                    "largest correlation that the last moves left",
                    format!("{:.3}", memory.moves.of_coordinates),
                ),
                Fact::new("families of particles that are left", format!("{families:.0}")),
                Fact::new("information gained, in nats", format!("{information:.2}")),
            ],
        }
    }

    fn doubts(&self, state: &State, memory: &Memory, families: f64) -> Vec<String> {
        let mut doubts = Vec::new();
        if memory.temperature < 1.0 {
            doubts.push(format!(
                "the particles stopped at the power {:.3e} of the likelihood instead of 1, after {} \
                 temperatures: they are not distributed like the posterior; raise `temperatures`",
                memory.temperature, memory.generations
            ));
        }
        if families < FAMILIES {
            doubts.push(format!(
                "the particles descend from only {families:.1} draws of the prior, too few to estimate the \
                 error of the evidence: raise `particles` or lower `correlation`"
            ));
        }
        let distinct = distinct(state);
        if 2 * distinct < self.particles {
            doubts.push(format!(
                "only {distinct} of {} particles are distinct: lower `correlation` or raise `moves`",
                self.particles
            ));
        }
        // Coordinates may still be correlated with the mode they started in; the likelihood must not be.
        let error = 1.0 / (self.particles as f64).sqrt();
        if memory.moves.of_likelihood > self.correlation + 2.0 * error {
            doubts.push(format!(
                "the likelihoods of the particles before and after their last {} moves have the correlation \
                 {:.2}: raise `moves`",
                self.moves, memory.moves.of_likelihood
            ));
        }
        doubts
    }
}

/// Returns the standard error of the log evidence, at least that of particles independent at each temperature.
fn evidence_error(memory: &Memory) -> f64 {
    let tree = evidence_variance(&memory.families, memory.generations);
    // The standard deviation of the logarithm of a log-normal number with this relative variance.
    tree.max(memory.independent_variance).ln_1p().sqrt()
}

/// Returns the number of independent draws the particles are worth, for the worst coordinate.
fn worth(state: &State, memory: &Memory) -> f64 {
    let size = |values: &[f64]| effective_size(&memory.families, memory.generations, values);
    let coordinates = (0..state.points.columns()).map(|j| size(&state.points.column(j)));
    coordinates.fold(distinct(state) as f64, f64::min)
}

fn distinct(state: &State) -> usize {
    let mut rows: Vec<&[f64]> = state.points.iter_rows().collect();
    let order = |a: &&[f64], b: &&[f64]| {
        let first = a.iter().zip(*b).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne());
        first.unwrap_or(std::cmp::Ordering::Equal)
    };
    rows.sort_by(order);
    rows.dedup();
    rows.len()
}
