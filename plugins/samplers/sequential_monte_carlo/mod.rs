//! `sequential_monte_carlo`: a population of particles that is cooled from the prior to the posterior.

mod genealogy;
mod harvest;
mod temperature;

use lacuna::linalg::Matrix;
use lacuna::math::random::Stream;
use lacuna::plugin::sampler::{Harvest, Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::study::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::evaluated::{Evaluated, Shape};
use super::moves::{Learned, Movement, Mutation, Others};
use super::population::{self, Share};

/// Sequential Monte Carlo: a population of particles that is led from the prior to the posterior by
/// raising the likelihood to a power that grows from 0 to 1.
///
/// It needs no starting point, finds several modes where the prior reaches them, and gives the evidence (the
/// probability of the data, from which Bayes factors follow) with its standard error. At each
/// temperature the particles are weighted, drawn anew in proportion to their weights, and moved by
/// Metropolis steps whose size and shape are learned from points of similar likelihood, and which change the scale of
/// a point as well: an unknown variance and its misfit fall through a funnel together. Choose it for comparing models and for
/// posteriors with several modes; for one well-shaped posterior a Markov chain gives more draws for
/// the same work.
///
/// The standard error of the evidence comes from the family tree of the particles: from how unequally the
/// draws of the prior are represented at the end (Lee and Whiteley). It is too small when
/// few families are left, and the report says so.
///
/// References: Neal, Statistics and Computing 11 (2001) 125; Del Moral, Doucet and Jasra, J. R. Stat.
/// Soc. B 68 (2006) 411; Lee and Whiteley, Biometrika 105 (2018) 609 (errors); Ter Braak, Statistics
/// and Computing 16 (2006) 239 (differential evolution).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SequentialMonteCarlo {
    /// The number of particles; the error of the evidence falls as one over its root.
    pub particles: usize,
    /// The share of the particles that a change of temperature leaves effective: the next temperature is the
    /// highest one at which the weights are still so equal.
    pub effective_share: f64,
    /// How particles move at one temperature.
    pub mutation: Mutation,
    /// Particles move until the correlation of each coordinate, and of the likelihood, with its value
    /// before the moves has fallen to this.
    pub correlation: f64,
    /// The most moves of each particle at one temperature.
    pub moves: usize,
    /// The most temperatures.
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

/// What is kept from temperature to temperature.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
struct Memory {
    /// The power of the likelihood.
    temperature: f64,
    /// The log of the evidence at that power.
    log_evidence: f64,
    /// The variance that this would have, were the particles independent at each temperature.
    independent_variance: f64,
    /// How often the particles were drawn anew.
    generations: usize,
    /// From which draw of the prior each particle descends.
    families: Vec<usize>,
    /// What is learned about the moves.
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
