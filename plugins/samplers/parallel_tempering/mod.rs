//! `parallel_tempering`: ensembles of walkers at several temperatures that exchange their points.

mod evidence;
mod ladder;
mod levels;
#[cfg(test)]
mod tests;

use lacuna::math::random::Stream;
use lacuna::plugin::sampler::{Evidence, Plan, Start, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Size, Target};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{chains, population};
use evidence::Record;
use ladder::Ladder;
use levels::Levels;

/// Parallel tempering: ensembles of walkers at several temperatures, from the posterior to the prior, whose neighbours
/// exchange points.
///
/// At the temperature `T` the likelihood is raised to the power `1 / T`. Hot walkers cross between maxima that are
/// separated by deep valleys, and their points reach the posterior through the exchanges. Choose it for posteriors with
/// several separate maxima if more draws are wanted than `sequential_monte_carlo` gives, and for evidences of models whose
/// likelihood has no sudden rises; a single well-shaped maximum needs one temperature only, and any other sampler is
/// cheaper by the number of temperatures.
///
/// At the highest temperature, which is infinite, every step draws from the prior itself. At the others walkers move
/// half by half, by stretches along the line through another walker and by differences between two others. During the
/// warm-up the temperatures adapt until all neighbours exchange points equally often; afterwards they are fixed. The
/// evidence follows from the ratios of the normalising constants of neighbours (stepping stones), its standard error
/// from the means over batches of steps.
///
/// References: Vousden, Farr and Mandel, Monthly Notices of the Royal Astronomical Society 455 (2016) 1919 (the
/// temperatures); Xie, Lewis, Fan, Kuo and Chen, Systematic Biology 60 (2011) 150 (stepping stones); Earl and Deem,
/// Physical Chemistry Chemical Physics 7 (2005) 3910; Goodman and Weare, Communications in Applied Mathematics and
/// Computational Science 5 (2010) 65 (stretches).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ParallelTempering {
    /// Number of walkers at each temperature, even, more than twice the number of unknowns.
    pub walkers: usize,
    /// Number of temperatures, at least 2, including that of the posterior and the infinite one.
    pub temperatures: usize,
    /// Number of steps of each walker, including the warm-up. A step costs one evaluation for each walker and
    /// temperature.
    pub steps: usize,
    /// Number of initial steps in which the temperatures adapt; they are discarded.
    pub warm_up: usize,
}

impl Default for ParallelTempering {
    fn default() -> Self {
        Self { walkers: 40, temperatures: 12, steps: 3000, warm_up: 1000 }
    }
}

impl Component for ParallelTempering {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        chains::check_steps(self.steps, self.warm_up, complaints);
        let least = 2 * (context.parameters.len() + 1);
        if self.walkers < least || !self.walkers.is_multiple_of(2) {
            complaints
                .at("walkers")
                .say("the walkers of a temperature move half by half, and each half must span the unknowns")
                .expected(format!("an even number, at least {least}"))
                .found(self.walkers);
        }
        if self.temperatures < 2 {
            complaints
                .at("temperatures")
                .say("walkers at one temperature have nobody to exchange points with")
                .expected("at least 2, that of the posterior and the infinite one")
                .found(self.temperatures);
        }
    }

    fn room(&self, unknowns: usize) -> Vec<Size> {
        // A walker has its point and two densities, as numbers and as values of four times the size in the state.
        let numbers = (5 * (unknowns + 2)).saturating_mul(self.walkers);
        let what = "the walkers of all temperatures";
        vec![Size { key: "temperatures", what, value: self.temperatures, numbers }]
    }
}

/// Memory of the sampler between steps.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Memory {
    ladder: Ladder,
    /// Walkers of all temperatures but the first, which are the points of the state.
    hot: Levels,
    /// Log prior density of the walkers of the first temperature.
    log_prior: Vec<f64>,
    record: Record,
    /// Number of steps so far.
    steps: usize,
}

impl Sampler for ParallelTempering {
    fn steps_are_draws(&self) -> bool {
        true
    }

    fn start_where(&self) -> Start {
        Start::Prior
    }

    fn plan(&self, _dimension: usize) -> Plan {
        let Self { walkers, steps, warm_up, .. } = *self;
        Plan { chains: walkers, steps, warm_up, ensemble: true }
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        chains::check_points(&points, self.walkers, target.dimension(), "walkers")?;
        let log_density = chains::log_density(target, &points, "walkers")?;
        let log_prior = target.log_prior(&points);
        let cold = Levels::new(&points, &log_density, &log_prior);
        let memory = Memory {
            ladder: Ladder::new(self.temperatures, target.dimension()),
            hot: cold.repeated(self.temperatures - 1),
            log_prior,
            record: Record::new(self.temperatures, self.steps - self.warm_up.min(self.steps)),
            steps: 0,
        };
        let memory = serde_json::to_value(memory).map_err(|e| Stop::new(e.to_string()))?;
        Ok(chains::state(points, log_density, memory))
    }

    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        let mut memory: Memory = population::remembered(state)?;
        let mut all = Levels::new(&state.points, &state.log_density, &memory.log_prior);
        all.append(&memory.hot);
        let before = state.points.clone();
        state.evaluations += all.step(target, &memory.ladder.powers, &stream.named("move"));
        let exchanged = all.exchange(&memory.ladder.powers, &stream.named("exchange"));
        memory.ladder.count(&exchanged);
        if memory.steps < self.warm_up {
            memory.ladder.adapt(&exchanged, memory.steps);
        } else {
            memory.record.add(&memory.ladder.powers, &all);
        }
        if memory.steps + 1 == self.warm_up {
            memory.ladder.forget();
        }
        memory.steps += 1;
        let cold = all.take_first();
        (state.points, state.log_density) = (cold.matrix(), cold.log_density);
        memory.log_prior = cold.log_prior;
        memory.hot = all;
        let moved = (0..self.walkers).map(|i| state.points.row(i) != before.row(i));
        state.accepted = moved.collect();
        state.memory = serde_json::to_value(memory).map_err(|e| Stop::new(e.to_string()))?;
        Ok(())
    }

    fn evidence(&self, state: &State) -> Option<Evidence> {
        let memory: Memory = population::remembered(state).ok()?;
        let (log, error) = memory.record.evidence()?;
        let method = format!("stepping stones between {} temperatures", self.temperatures);
        Some(Evidence { log, error, method })
    }

    fn doubts(&self, state: &State) -> Vec<String> {
        let Ok(memory) = population::remembered::<Memory>(state) else { return Vec::new() };
        let least = memory.ladder.rates().into_iter().fold(f64::INFINITY, f64::min);
        if least >= ladder::SELDOM {
            return Vec::new();
        }
        vec![format!(
            "two neighbouring temperatures exchange only {:.1} % of their points: raise `temperatures`",
            100.0 * least
        )]
    }

    fn facts(&self) -> Vec<Fact> {
        vec![
            Fact::new("walkers at each temperature", self.walkers),
            Fact::new("temperatures", self.temperatures),
            Fact::new("steps of the warm-up", self.warm_up),
        ]
    }
}

lacuna::register!(Sampler, "parallel_tempering", ParallelTempering, aliases: ["ptmcmc", "ptemcee"]);
