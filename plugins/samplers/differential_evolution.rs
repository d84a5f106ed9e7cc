//! `differential_evolution`: few chains that jump by differences between past points.

use lacuna::math::random::{Stream, normal, uniform};
use lacuna::plugin::sampler::{Plan, Start, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use rand::Rng;
use rand::rngs::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::archive::{self, Archive};
use super::proposal::Proposal;
use super::{chains, snooker};

/// Probability of a jump by the full difference, which can lead from one mode to another.
const LEAPS: f64 = 0.1;
/// Relative half-width of the uniform distribution of the lengths of the other jumps.
const STRETCH: f64 = 0.1;
/// Standard deviation of the normal noise added to every jump, relative to that of the initial archive. With it the
/// chain can reach every point, not only the combinations of archived ones.
const NOISE: f64 = 1e-4;

/// Differential evolution with an archive, DE-MC(Z): few chains, each of which jumps by the difference between two
/// points that any of the chains has visited before.
///
/// The archive takes the shape of the density, so that nothing has to be tuned and few chains suffice. One jump in
/// ten has the full length of the difference, which leads from one mode to another once the archive holds points of
/// both; snooker moves, along the line through another point, do so too. It suits up to about thirty unknowns and
/// several modes.
///
/// The chains start at draws of the whole prior unless the study sets `start`, so that each mode has a chance to be
/// found by some of them. The archive starts with ten draws of the prior and ten points of a normal cloud for each
/// unknown: the former for jumps between modes, the latter for steps within one. The points of the chains are added
/// at every tenth step, and the older half of the archive is dropped at the end of the warm-up. The archive keeps
/// growing, so that the chains are exact only in the limit; each addition changes it less than the one before. Above
/// two thousand points every second visit is dropped, and new ones are added half as often. The chains share nothing
/// but the archive and count as independent.
///
/// References: ter Braak and Vrugt, Statistics and Computing 18 (2008) 435; ter Braak, Statistics and Computing 16
/// (2006) 239.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DifferentialEvolution {
    /// Number of chains, at least 2; convergence is judged by comparing them.
    pub chains: usize,
    /// Number of steps of each chain, including the warm-up. A step costs one evaluation per chain.
    pub steps: usize,
    /// Number of initial steps that are discarded; at their end the older half of the archive is dropped.
    pub warm_up: usize,
    /// Fraction of snooker moves, from 0 to 1.
    pub snooker: f64,
    /// Covariance of the initial cloud: `"curvature"`, that of the normal approximation at the maximum of the
    /// density, or a fraction of the prior's width, such as `{ prior = 1.0 }`.
    pub archive: Proposal,
}

impl Default for DifferentialEvolution {
    fn default() -> Self {
        Self { chains: 4, steps: 10_000, warm_up: 2000, snooker: 0.1, archive: Proposal::Curvature }
    }
}

impl DifferentialEvolution {
    /// Writes the proposed point of a chain into `new` and returns the logarithm of the factor on the ratio of the
    /// densities (1 for parallel moves, the Jacobian for snooker moves).
    fn propose(
        &self,
        archive: &Archive<'_>,
        from: &[f64],
        new: &mut [f64],
        rng: &mut impl Rng,
    ) -> f64 {
        if uniform(rng) < self.snooker {
            let [anchor, a, b] = archive.pick(rng);
            return snooker::propose(from, &anchor, (&a, &b), &archive.lengths, new, rng);
        }
        let [a, b] = archive.pick(rng);
        let length = if uniform(rng) < LEAPS {
            1.0
        } else {
            let stretch = 1.0 + STRETCH * (2.0 * uniform(rng) - 1.0);
            2.38 / (2.0 * from.len() as f64).sqrt() * stretch
        };
        for (j, new) in new.iter_mut().enumerate() {
            let noise = NOISE * archive.lengths[j] * normal(rng);
            *new = from[j] + length * (a[j] - b[j]) + noise;
        }
        0.0
    }
}

impl Component for DifferentialEvolution {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        chains::check_count(self.chains, complaints);
        chains::check_steps(self.steps, self.warm_up, complaints);
        self.archive.check(complaints);
        if !(0.0..=1.0).contains(&self.snooker) {
            complaints
                .at("snooker")
                .say("the fraction of snooker moves must be from 0 to 1")
                .expected("a number from 0 to 1")
                .found(self.snooker);
        }
    }
}

impl Sampler for DifferentialEvolution {
    fn steps_are_draws(&self) -> bool {
        true
    }

    fn plan(&self, _dimension: usize) -> Plan {
        Plan { chains: self.chains, steps: self.steps, warm_up: self.warm_up, ensemble: false }
    }

    fn start_where(&self) -> Start {
        Start::Prior
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        chains::check_points(&points, self.chains, target.dimension(), "chains")?;
        let log_density = chains::log_density(target, &points, "chains")?;
        let (shape, evaluations) = self.archive.shape(target, &points, &log_density)?;
        // The archive is part of the proposal, so that a fixed stream is sufficient.
        let prior = Stream::root(0).named("places");
        let draws = target.prior_draws(archive::first(target.dimension()), &prior);
        let memory = Archive::begin(&shape, &points, &log_density, &draws);
        let mut state = chains::state(points, log_density, memory);
        state.evaluations += evaluations;
        Ok(state)
    }

    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        let (count, dimension) = (state.points.rows(), state.points.columns());
        let mut generators: Vec<ChaCha8Rng> =
            (0..count).map(|chain| stream.at(chain as u64).generator()).collect();
        let mut points = Matrix::zeros(count, dimension);
        let archive = Archive::read(&state.memory, dimension)?;
        let factors: Vec<f64> = generators
            .iter_mut()
            .enumerate()
            .map(|(chain, rng)| {
                self.propose(&archive, state.points.row(chain), points.row_mut(chain), rng)
            })
            .collect();
        let log_density = target.log_density(&points);
        state.evaluations += count as u64;
        for (chain, rng) in generators.iter_mut().enumerate() {
            let ratio = factors[chain] + log_density[chain] - state.log_density[chain];
            // A NaN log density compares false, and the chain stays.
            let accepted = uniform(rng).ln() < ratio;
            chains::decide(state, chain, accepted, points.row(chain), log_density[chain]);
        }
        Archive::remember(&mut state.memory, &state.points, self.warm_up)
    }

    fn facts(&self) -> Vec<Fact> {
        vec![
            Fact::new("chains", self.chains),
            Fact::new("steps", self.steps),
            Fact::new("steps of the warm-up", self.warm_up),
            Fact::new("snooker moves", format!("{:.0} %", 100.0 * self.snooker)),
        ]
    }
}

lacuna::register!(Sampler, "differential_evolution", DifferentialEvolution, aliases: ["de", "demc", "dream"]);
