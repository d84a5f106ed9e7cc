//! `differential_evolution`: few chains that jump by differences between places of their past.

use lacuna::linalg::Matrix;
use lacuna::math::random::{Stream, normal, uniform};
use lacuna::plugin::sampler::{Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::study::Complaints;
use lacuna::study::file::Start;
use rand::Rng;
use rand::rngs::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::archive::{self, Archive};
use super::proposal::Proposal;
use super::{chains, snooker};

/// How often a jump has the whole length of the difference.
const LEAPS: f64 = 0.1;
/// The relative spread of the lengths of the other jumps: uniform within this on both sides.
const STRETCH: f64 = 0.1;
/// The standard deviation of what is added to every jump, in units of the first archive's, so that the
/// chain can reach every place and not only the combinations of the archive.
const NOISE: f64 = 1e-4;

/// Differential evolution with an archive, DE-MC(Z): few chains, each of which jumps by the difference
/// between two places that any of the chains has visited before.
///
/// The archive of the past takes the shape of the density, so that there is nothing to tune, and no need for
/// many chains. One jump in ten has the whole length of the difference, which leads from one mode to
/// another once the archive has both, and `snooker` is the share of moves along the line through
/// another place, which do so too. It suits up to some thirty unknowns and several modes.
///
/// The chains start at draws of the whole prior unless the study says `start`, so that each mode has a chance to catch some
/// of them. The archive starts with ten draws of the prior and ten places of a normal cloud for each unknown, the first for
/// jumps between modes and the second for steps within one. It takes in where the chains are at every
/// tenth step, and forgets its first half at the end of the warm-up. It keeps growing, so that the
/// chains are exact in the limit only; each addition weighs less than the one before. Above two thousand
/// places every second visit is dropped, and new ones come in half as often. Chains share nothing but
/// the archive and count as independent.
///
/// References: ter Braak and Vrugt, Statistics and Computing 18 (2008) 435; ter Braak, Statistics and Computing 16
/// (2006) 239.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DifferentialEvolution {
    /// The number of chains: at least two.
    pub chains: usize,
    /// The number of steps of each chain, those of the warm-up included.
    pub steps: usize,
    /// The number of first steps that are no draws, and after which the archive forgets its first half.
    pub warm_up: usize,
    /// The share of snooker moves.
    pub snooker: f64,
    /// The shape of the first cloud: `"curvature"`, the normal law that touches the density at its
    /// maximum, or a fraction of the width of the prior, such as `{ prior = 1.0 }`.
    pub archive: Proposal,
}

impl Default for DifferentialEvolution {
    fn default() -> Self {
        Self { chains: 4, steps: 10_000, warm_up: 2000, snooker: 0.1, archive: Proposal::Curvature }
    }
}

impl DifferentialEvolution {
    /// Writes where a chain would go into `new` and gives the logarithm of the factor that belongs
    /// to the ratio of the densities.
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
                .say("the share of snooker moves lies between none and all")
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
        // The archive is part of the proposal: any fixed stream will do.
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
            // A log density that is not a number compares false, and the chain stays.
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
