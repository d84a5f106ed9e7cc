//! `nested`: live points that rise through shells of equal prior volume.

mod harvest;
mod volumes;

use lacuna::math::random::{Stream, permutation, uniform};
use lacuna::math::special::ln_sum_exp;
use lacuna::plugin::sampler::{Harvest, Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::evaluated::{Evaluated, Shape};
use super::moves::{Learned, Movement, Mutation, Others, Side};
use super::population::{self, Share};
use volumes::Ladder;

/// Nested sampling: live points, initially draws of the prior, rise to ever higher likelihood while the prior volume
/// they occupy shrinks at a known rate.
///
/// It needs no starting points, finds several modes, and gives the evidence (the marginal likelihood, from which
/// Bayes factors follow) with its standard error, together with draws of the posterior. In each step the lower half
/// of the live points is removed; as many new points start as copies of survivors and move within the prior, above
/// the highest likelihood removed, until they have forgotten their start. It handles likelihoods with phase
/// transitions (sudden rises), where tempering fails; for smooth likelihoods `sequential_monte_carlo` gives the same
/// results at lower cost.
///
/// The uniform distribution of the new points is tested by their ranks among the survivors (Fowlie, Handley and Su);
/// the report says if the test fails.
///
/// References: Skilling, Bayesian Analysis 1 (2006) 833; Feroz and Hobson, MNRAS 384 (2008) 449; Henderson and
/// Goggans, ISBA 2014 (several points at a time); Fowlie, Handley and Su, MNRAS 497 (2020) 5256 (the test).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Nested {
    /// Number of live points, at least 20 times one more than the number of unknowns. The standard error of the log
    /// evidence is about `1.2 sqrt(information / live)`, with the information gain in nats; the cost is proportional
    /// to `live`.
    pub live: usize,
    /// Tolerance of the log evidence: the run ends when the live points could raise it by no more than this.
    pub remaining: f64,
    /// Kind of the moves of new points.
    pub mutation: Mutation,
    /// Correlation, between 0 and 1, at which a new point counts as independent: new points move until each
    /// coordinate and the likelihood are correlated with those of their survivor by no more than this. A smaller
    /// value costs more moves and gives a more reliable evidence.
    pub correlation: f64,
    /// Maximum number of moves of each new point.
    pub moves: usize,
    /// Maximum number of steps; each halves the prior volume.
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

/// Number of bins in which the ranks of new points are counted.
const BINS: usize = 50;
/// Log weight, relative to the evidence, below which removed points are dropped from memory.
const NEGLIGIBLE: f64 = -40.0;

/// Memory of the sampler between steps.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
struct Memory {
    /// Number of removed points dropped because of their negligible weight.
    forgotten: usize,
    /// Log-likelihood of each other removed point, in order of removal.
    dead: Vec<f64>,
    /// Coordinates of these points, one point after the other.
    points: Vec<f64>,
    /// Log density of these points.
    log_density: Vec<f64>,
    /// Log of the prior volume above the last removed point.
    log_volume: f64,
    /// Log evidence of the removed points; `None` before the first removal.
    log_evidence: Option<f64>,
    /// Log of the fraction of the prior inside the support, and its variance.
    log_share: f64,
    share_variance: f64,
    /// Number of new points in each bin of ranks among the survivors.
    ranks: Vec<u64>,
    /// Tuning of the moves.
    moves: Learned,
    /// True once the live points can no longer raise the evidence by more than the tolerance.
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
    /// Returns the memory before the first removal.
    fn first(support: Share) -> Self {
        let Share { log, variance } = support;
        let ranks = vec![0; BINS];
        Self { log_share: log, share_variance: variance, ranks, ..Self::default() }
    }

    /// Records the removal of the lowest of `live` points.
    fn bury(&mut self, point: &[f64], log_density: f64, log_likelihood: f64, live: usize) {
        let (log_width, next) = volumes::shell(self.log_volume, live);
        let weight = log_likelihood + log_width;
        self.log_volume = next;
        self.log_evidence = Some(self.log_evidence.map_or(weight, |z| ln_sum_exp(z, weight)));
        self.dead.push(log_likelihood);
        self.points.extend_from_slice(point);
        self.log_density.push(log_density);
    }

    /// Drops the removed points of negligible weight, which are the earliest.
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

/// Returns a number in (0, 1) that depends on the point alone and orders points of equal likelihood.
fn label(point: &[f64]) -> f64 {
    let stream = point.iter().fold(Stream::root(0), |stream, x| stream.at(x.to_bits()));
    uniform(&mut stream.generator())
}

/// Compares two points by likelihood, and by label if the likelihoods are equal.
fn order(a: (f64, &[f64]), b: (f64, &[f64])) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0).then_with(|| label(a.1).total_cmp(&label(b.1)))
}

/// Splits the survivors into two halves; the proposals of the copies of each half are built from the other half.
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
    /// Replaces the lower half of the live points; returns a flag per point that is true if it is new.
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
