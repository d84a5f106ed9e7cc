//! `sequential_monte_carlo`: a population of particles tempered from the prior to the posterior.

mod genealogy;
mod harvest;
mod temperature;

use lacuna::math::random::Stream;
use lacuna::plugin::sampler::{Harvest, Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::evaluated::{Evaluated, Shape};
use super::moves::{Learned, Movement, Mutation, Others};
use super::population::{self, Share};

/// Sequential Monte Carlo: a population of particles that moves from the prior to the posterior as the likelihood is
/// raised to a power that grows from 0 to 1.
///
/// It needs no starting points, finds several modes where the prior reaches them, and gives the evidence (the
/// marginal likelihood, from which Bayes factors follow) with its standard error. At each temperature the particles
/// are weighted, resampled in proportion to their weights, and moved by Metropolis steps. The size and shape of the
/// steps are learnt from points of similar likelihood; some steps change the scale of a point, so that an unknown
/// variance and its misfit can decrease together through a funnel. Choose it to compare models and for posteriors
/// with several modes; for a single well-shaped mode a Markov chain gives more draws at the same cost.
///
/// The standard error of the evidence is estimated from the genealogy of the particles, i.e. from how unequally the
/// initial draws of the prior are represented at the end (Lee and Whiteley). It is too small if few families are
/// left; the report then says so.
///
/// References: Neal, Statistics and Computing 11 (2001) 125; Del Moral, Doucet and Jasra, J. R. Stat. Soc. B 68
/// (2006) 411; Lee and Whiteley, Biometrika 105 (2018) 609 (errors); ter Braak, Statistics and Computing 16 (2006)
/// 239 (differential evolution).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SequentialMonteCarlo {
    /// Number of particles, at least 10 times one more than the number of unknowns. The standard error of the
    /// evidence decreases as `1 / sqrt(particles)`; the cost is proportional to it.
    pub particles: usize,
    /// Effective fraction of the particles after a change of temperature, between 0 and 1: the next temperature is
    /// the one at which the weights have this effective size. A larger value gives more temperatures, a higher cost
    /// and a smaller error.
    pub effective_share: f64,
    /// Kind of the moves at one temperature.
    pub mutation: Mutation,
    /// Correlation, between 0 and 1, at which the moves at one temperature end: particles move until each coordinate
    /// and the likelihood are correlated with their values before the moves by no more than this. A smaller value
    /// costs more moves.
    pub correlation: f64,
    /// Maximum number of moves of each particle at one temperature.
    pub moves: usize,
    /// Maximum number of temperatures.
    pub temperatures: usize,
}

impl Default for SequentialMonteCarlo {
    fn default() -> Self {
        Self {
            particles: 1000,
            effective_share: 0.75,
            mutation: Mutation::Automatic,
            correlation: 0.1,
            moves: 50,
            temperatures: 200,
        }
    }
}

impl Component for SequentialMonteCarlo {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let least = 10 * (context.parameters.len() + 1);
        if self.particles < least {
            let spot = complaints.at("particles");
            spot.say("too few particles to learn their covariance")
                .expected(format!("at least {least}"))
                .found(self.particles);
        }
        let shares = [("effective_share", self.effective_share), ("correlation", self.correlation)];
        population::check_shares(&shares, complaints);
        let counts = [("moves", self.moves), ("temperatures", self.temperatures)];
        population::check_counts(&counts, complaints);
    }
}

/// Memory of the sampler between temperatures.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
struct Memory {
    /// Power of the likelihood, from 0 to 1 (an inverse temperature).
    temperature: f64,
    /// Log evidence at that power.
    log_evidence: f64,
    /// Variance of the log evidence if the particles were independent at each temperature.
    independent_variance: f64,
    /// Number of resamplings.
    generations: usize,
    /// Index of the prior draw from which each particle descends.
    families: Vec<usize>,
    /// Tuning of the moves.
    moves: Learned,
}

impl Sampler for SequentialMonteCarlo {
    fn plan(&self, _dimension: usize) -> Plan {
        Plan { chains: self.particles, steps: self.temperatures, warm_up: 0, ensemble: true }
    }

    fn uses_starts(&self) -> bool {
        false
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        population::start(target, points, self.particles)
    }

    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        let first = |support: Share| Memory {
            log_evidence: support.log,
            independent_variance: support.variance,
            families: (0..self.particles).collect(),
            ..Memory::default()
        };
        let (mut population, mut memory) = population::resume(target, state, first, stream)?;
        let shape = if memory.temperature < 1.0 {
            self.cool(&mut population, &mut memory, &stream.named("cool"))?
        } else {
            let equal = vec![1.0 / self.particles as f64; self.particles];
            Shape::of(&population.points, &equal)?
        };
        let stream = stream.named("move");
        let power = memory.temperature;
        let movement = Movement {
            target,
            mutation: self.mutation,
            correlation: self.correlation,
            most: self.moves,
            law: &|old, i, new, j| {
                new.log_prior[j] - old.log_prior[i]
                    + power * (new.log_likelihood(j) - old.log_likelihood(i))
            },
            others: Others::OtherHalf(&shape),
            ahead: false,
        };
        state.accepted = movement.run(&mut population, &mut memory.moves, &stream);
        population::keep(state, population, &memory)
    }

    fn finished(&self, state: &State) -> bool {
        state.memory.get("temperature").and_then(serde_json::Value::as_f64) == Some(1.0)
    }

    fn harvest(
        &self,
        target: &dyn Target,
        state: &State,
        stream: &Stream,
    ) -> Result<Option<Harvest>, Stop> {
        let memory = population::remembered(state)?;
        Ok(Some(self.bring_home(target, state, &memory, stream)))
    }

    fn facts(&self) -> Vec<Fact> {
        vec![
            Fact::new("particles", self.particles),
            Fact::new("effective share", self.effective_share),
            Fact::new("correlation after moves", self.correlation),
        ]
    }
}

lacuna::register!(Sampler, "sequential_monte_carlo", SequentialMonteCarlo, aliases: ["smc", "tmcmc"]);

#[cfg(test)]
mod tests;
