//! `nested`: live points that climb through shells of equal prior volume.

mod harvest;
mod volumes;

use lacuna::linalg::Matrix;
use lacuna::math::random::{Stream, permutation, uniform};
use lacuna::math::special::ln_sum_exp;
use lacuna::plugin::sampler::{Harvest, Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::study::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::evaluated::{Evaluated, Shape};
use super::moves::{Learned, Movement, Mutation, Others, Side};
use super::population::{self, Share};
use volumes::Ladder;

/// Nested sampling: live points, spread over the prior, that climb to ever higher likelihood while the prior
/// volume in which they live shrinks at a known rate.
///
/// It needs no starting point, finds several modes, and gives the evidence (the probability of the
/// data, from which Bayes factors follow) with its standard error, and draws of the posterior as
/// well. In each step the lower half of the live points dies; as many new ones start from survivors and
/// move inside the prior, above the highest likelihood that died, until they have forgotten their
/// start. It follows likelihoods with sudden rises, where tempering fails; for smooth ones
/// `sequential_monte_carlo` gives the same for less work.
///
/// Whether new points are spread as they should be is tested by their ranks among the survivors
/// (Fowlie, Handley and Su), and the report says when they are not.
///
/// References: Skilling, Bayesian Analysis 1 (2006) 833; Feroz and Hobson, MNRAS 384 (2008) 449;
/// Henderson and Goggans, ISBA 2014 (several points at a time); Fowlie, Handley and Su, MNRAS 497
/// (2020) 5256 (the test).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Nested {
    /// The number of live points; the error of the log evidence is about `1.2 sqrt(information / live)`,
    /// with the information gained in nats.
    pub live: usize,
    /// The run ends when the live points could raise the log evidence by no more than this.
    pub remaining: f64,
    /// How new points move.
    pub mutation: Mutation,
    /// New points move until the correlation of each coordinate, and of the likelihood, with that of
    /// the survivor from which they started has fallen to this.
    pub correlation: f64,
    /// The most moves of each new point.
    pub moves: usize,
    /// The most halvings of the prior volume.
    pub halvings: usize,
}

impl Default for Nested {
    fn default() -> Self {
        Self {
            live: 500,
            remaining: 0.01,
            mutation: Mutation::DifferentialEvolution,
            correlation: 0.1,
            moves: 100,
            halvings: 1000,
        }
    }
}

impl Component for Nested {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let least = 20 * (context.parameters.len() + 1);
        if self.live < least {
            let spot = complaints.at("live");
            spot.say("too few live points to learn their covariance")
                .expected(format!("at least {least}"))
                .found(self.live);
        }
        if !(self.remaining > 0.0 && self.remaining.is_finite()) {
            let spot = complaints.at("remaining");
            spot.say("the run would never end").expected("a number above 0").found(self.remaining);
        }
        population::check_shares(&[("correlation", self.correlation)], complaints);
        let counts = [("moves", self.moves), ("halvings", self.halvings)];
        population::check_counts(&counts, complaints);
    }
}

/// Bins in which ranks of new points are counted.
const BINS: usize = 50;
/// Dead points whose weight is below this power of e, relative to the evidence, are forgotten.
const NEGLIGIBLE: f64 = -40.0;

/// What is kept from step to step.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
struct Memory {
    /// How many dead points are forgotten, because they weigh nothing.
    forgotten: usize,
    /// The log-likelihood of each other dead point in the order of their deaths.
    dead: Vec<f64>,
    /// The coordinates of those, point by point.
    points: Vec<f64>,
    /// The log density of those.
    log_density: Vec<f64>,
    /// The log of the prior volume above the last that died.
    log_volume: f64,
    /// The log of the evidence of the dead; none before the first death with any.
    log_evidence: Option<f64>,
    /// The log of the share of the prior inside the support, and its variance.
    log_share: f64,
    share_variance: f64,
    /// How often new points took each rank among the survivors.
    ranks: Vec<u64>,
    /// What is learned about the moves.
    moves: Learned,
    /// Whether the live points can add no more to the evidence.
    finished: bool,
}

impl Sampler for Nested {
    fn plan(&self, _dimension: usize) -> Plan {
        Plan { chains: self.live, steps: self.halvings, warm_up: 0, ensemble: true }
    }

    fn uses_starts(&self) -> bool {
        false
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        population::start(target, points, self.live)
    }

    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        let (mut live, mut memory) = population::resume(target, state, Memory::first, stream)?;
        state.accepted = vec![false; self.live];
        if !memory.finished {
            state.accepted = self.halve(target, &mut live, &mut memory, stream)?;
        }
        population::keep(state, live, &memory)
    }

    fn finished(&self, state: &State) -> bool {
        state.memory.get("finished").and_then(serde_json::Value::as_bool) == Some(true)
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
            Fact::new("live points", self.live),
            Fact::new("correlation after moves", self.correlation),
            Fact::new("evidence that may remain", self.remaining),
        ]
    }
}

impl Memory {
    /// Before the first death.
    fn first(support: Share) -> Self {
        let Share { log, variance } = support;
        let ranks = vec![0; BINS];
        Self { log_share: log, share_variance: variance, ranks, ..Self::default() }
    }

    /// One more dead point, the lowest of `live`.
    fn bury(&mut self, point: &[f64], log_density: f64, log_likelihood: f64, live: usize) {
        let (log_width, next) = volumes::shell(self.log_volume, live);
        let weight = log_likelihood + log_width;
        self.log_volume = next;
        self.log_evidence = Some(self.log_evidence.map_or(weight, |z| ln_sum_exp(z, weight)));
        self.dead.push(log_likelihood);
        self.points.extend_from_slice(point);
        self.log_density.push(log_density);
    }

    /// Forgets the dead points that weigh nothing; they are the earliest.
    fn forget(&mut self, live: usize) {
        let Some(evidence) = self.log_evidence else { return };
        let d = self.points.len() / self.dead.len().max(1);
        let ladder = Ladder { forgotten: self.forgotten, rungs: &self.dead, live, ended: false };
        let weighs_nothing = |weight: &&f64| **weight < evidence + NEGLIGIBLE;
        let light = ladder.mean_weights().iter().take_while(weighs_nothing).count();
        self.forgotten += light;
        self.dead.drain(..light);
        self.log_density.drain(..light);
        self.points.drain(..light * d);
    }
}

/// A number in (0, 1) that depends on a point alone, by which points of equal likelihood are ordered.
fn label(point: &[f64]) -> f64 {
    let stream = point.iter().fold(Stream::root(0), |stream, x| stream.at(x.to_bits()));
    uniform(&mut stream.generator())
}

/// Whether a point lies higher than another: by likelihood, by label where that is equal.
fn order(a: (f64, &[f64]), b: (f64, &[f64])) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0).then_with(|| label(a.1).total_cmp(&label(b.1)))
}

/// The survivors in two halves: the copies of each half learn from the other half.
fn sides(survivors: &Evaluated, parents: &[usize]) -> Result<[Side; 2], Stop> {
    let (first, second) = parents.split_at(parents.len() / 2);
    let side = |copies: std::ops::Range<usize>, others: &[usize]| {
        let others = survivors.select(others);
        let equal = vec![1.0 / others.points.rows() as f64; others.points.rows()];
        let shape = Shape::of(&others.points, &equal)?;
        Ok::<Side, Stop>(Side { movers: copies.collect(), others, shape })
    };
    Ok([side(0..first.len(), second)?, side(first.len()..parents.len(), first)?])
}

impl Nested {
    /// The lower half of the live points dies and is replaced; which points are new.
    fn halve(
        &self,
        target: &dyn Target,
        live: &mut Evaluated,
        memory: &mut Memory,
        stream: &Stream,
    ) -> Result<Vec<bool>, Stop> {
        let likelihood = live.log_likelihoods();
        let at = |i: usize| (likelihood[i], live.points.row(i));
        let mut rising: Vec<usize> = (0..self.live).collect();
        rising.sort_by(|&a, &b| order(at(a), at(b)));
        let (dying, surviving) = rising.split_at(self.live / 2);
        for (already, &i) in dying.iter().enumerate() {
            let alive = self.live - already;
            memory.bury(live.points.row(i), live.log_density[i], likelihood[i], alive);
        }
        let last = dying[dying.len() - 1];
        let (bound, edge) = (likelihood[last], live.points.row(last).to_vec());
        let survivors = live.select(surviving);
        let mut rng = stream.named("birth").generator();
        let parents = &permutation(&mut rng, survivors.points.rows())[..dying.len()];
        let mut born = survivors.select(parents);
        let sides = sides(&survivors, parents)?;
        let movement = Movement {
            target,
            mutation: self.mutation,
            correlation: self.correlation,
            most: self.moves,
            law: &|old, i, new, j| {
                let place = (new.log_likelihood(j), new.points.row(j));
                if order(place, (bound, &edge)).is_gt() {
                    new.log_prior[j] - old.log_prior[i]
                } else {
                    f64::NEG_INFINITY
                }
            },
            others: Others::Apart(&sides),
            ahead: true,
        };
        movement.run(&mut born, &mut memory.moves, &stream.named("move"));
        let ranked: Vec<_> = surviving.iter().map(|&i| at(i)).collect();
        for row in 0..dying.len() {
            let place = (born.log_likelihood(row), born.points.row(row));
            let below_it = ranked.partition_point(|&other| order(other, place).is_lt());
            memory.ranks[below_it * BINS / (ranked.len() + 1)] += 1;
        }
        let mut fresh = vec![false; self.live];
        for (row, &i) in dying.iter().enumerate() {
            live.replace(i, &born, row);
            fresh[i] = true;
        }
        live.evaluations += born.evaluations;
        memory.forget(self.live);
        let highest = live.log_likelihoods().into_iter().fold(f64::NEG_INFINITY, f64::max);
        let rest = highest + memory.log_volume - memory.log_evidence.unwrap_or(f64::INFINITY);
        memory.finished = rest.exp().ln_1p() < self.remaining;
        Ok(fresh)
    }
}

lacuna::register!(Sampler, "nested", Nested, aliases: ["nested_sampling", "dynesty", "multinest", "ultranest"]);

#[cfg(test)]
mod tests;
