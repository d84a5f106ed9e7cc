//! `transport`: no-U-turn trajectories in coordinates that straighten the posterior.

mod fit;
mod map;
mod transported;

use lacuna::data::Statistic;
use lacuna::diagnose::chains::r_hat;
use lacuna::math::random::Stream;
use lacuna::math::transform::Unconstrained;
use lacuna::plugin::sampler::{Plan, State};
use lacuna::plugin::{Component, Context, Fact, Sampler, Target};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use self::map::{Form, Map};
use self::transported::Transported;
use super::hamiltonian::chains::{self, foreign};
use super::hamiltonian::{Settings, told};
use super::no_u_turn::tree;

/// No-U-turn sampler with a learnt transport: trajectories in coordinates in which the posterior is nearly a standard
/// normal distribution.
///
/// For smooth posteriors whose width or place changes along the posterior, such as funnels (the scale of a population and its
/// members) and bent ridges, in which one step size fits nowhere. The warm-up has three rounds. The first moves in the
/// coordinates of `no_u_turn`; after the first and the second a triangular map is fitted to the draws of the second half
/// of the round. In it each coordinate has a location and a scale that may depend on those before it: the location
/// linearly or quadratically, the logarithm of the scale linearly, with the terms that are sure and predict the other half
/// of the draws. The draws are exact whatever the map is: the density includes its determinant. No map is fitted while the chains
/// disagree; where no coordinate depends on others, the sampler is `no_u_turn` with a longer warm-up. A chain stays at the mode it finds.
///
/// References: Parno and Marzouk, SIAM/ASA J. Uncertainty Quantification 6 (2018) 645; Hoffman et al., NeuTra-lizing bad
/// geometry in Hamiltonian Monte Carlo, arXiv:1903.03704 (2019).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Transport {
    /// Number of independent chains, at least 1; use several, because convergence is judged by comparing them.
    pub chains: usize,
    /// Number of steps of each chain, including the warm-up.
    pub steps: usize,
    /// Number of initial steps in which map, step size and metric are learnt, at least 150; they are discarded.
    pub warm_up: usize,
    /// Maximum tree depth, from 1 to 20: a step costs up to `2^depth - 1` gradients.
    pub depth: u32,
    /// Target mean acceptance rate along a trajectory to which the step size is tuned, from 0.1 to below 1.
    pub target_acceptance: f64,
}

impl Default for Transport {
    fn default() -> Self {
        Self { chains: 4, steps: 2500, warm_up: 1500, depth: 10, target_acceptance: 0.9 }
    }
}

/// Fewest steps of the warm-up from which a map can be learnt.
const SHORTEST_WARM_UP: usize = 150;
/// Rounds of the warm-up: the last one learns no map, but the step size for the last map.
const ROUNDS: usize = 3;
/// Largest R-hat of a coordinate with which the draws of a round are a sample of one distribution, if a poor one.
const LARGEST_R_HAT: f64 = 1.5;
/// Largest number of values of which a map is fitted: of more, every second, third ... step is taken.
const MOST_VALUES: usize = 20_000;

/// Memory of the sampler between steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Memory {
    /// Number of steps done.
    step: usize,
    /// The present map; `None` in the first round, and while the chains disagree.
    map: Option<Map>,
    /// Free points of the second half of the present round, those of one step after those of another.
    gathered: Vec<Vec<f64>>,
    /// State of the trajectories in the present coordinates.
    points: Matrix,
    inner: Value,
}

impl Transport {
    /// Settings of the trajectories in a round.
    fn settings(&self, round: usize) -> Settings {
        let length = self.end(round) - if round == 0 { 0 } else { self.end(round - 1) };
        // The last round learns until the draws begin.
        let warm_up = if round + 1 == ROUNDS { length } else { length / 2 };
        Settings {
            chains: self.chains,
            steps: self.steps,
            warm_up,
            target_acceptance: self.target_acceptance,
            metric: None,
        }
    }

    /// Steps of the warm-up at which a round ends.
    fn end(&self, round: usize) -> usize {
        self.warm_up * (round + 1) / ROUNDS
    }

    fn round(&self, step: usize) -> usize {
        (0..ROUNDS).find(|&round| step < self.end(round)).unwrap_or(ROUNDS - 1)
    }

    /// True for the steps of a round after which the points are kept for a map: those of its second half.
    fn gathers(&self, step: usize, dimension: usize) -> bool {
        let round = self.round(step);
        let begun = if round == 0 { 0 } else { self.end(round - 1) };
        let half = (self.end(round) - begun).div_ceil(2);
        let stride = (half * self.chains * dimension).div_ceil(MOST_VALUES).max(1);
        let into = step - begun;
        round + 1 < ROUNDS && into >= half && (into - half).is_multiple_of(stride)
    }

    /// The map of gathered points; `None` if the chains disagree about them.
    fn learnt(&self, gathered: &[Vec<f64>]) -> Option<Map> {
        let dimension = gathered.first()?.len();
        let agrees = |j: usize| {
            let of = |chain| gathered.iter().skip(chain).step_by(self.chains).map(|u| u[j]);
            let mut chains: Vec<Vec<f64>> = (0..self.chains).map(|c| of(c).collect()).collect();
            if self.chains == 1 {
                let half = chains[0].len() / 2;
                let late = chains[0][half..2 * half].to_vec();
                chains[0].truncate(half);
                chains.push(late);
            }
            r_hat(&chains) <= LARGEST_R_HAT
        };
        let draws = Matrix::from_rows(dimension, gathered);
        (0..dimension).all(agrees).then(|| Map::of(&draws, self.chains)).flatten()
    }

    /// A state of the trajectories as the caller sees it: points and densities of the target.
    fn outside(
        target: &dyn Target,
        memory: &Memory,
        inner: &State,
        before: u64,
    ) -> Result<State, Stop> {
        let transported = Transported::new(target, memory.map.as_ref());
        let points = transported.points(&inner.points);
        let log_density = target.log_density(&points);
        Ok(State {
            evaluations: before + inner.evaluations + points.rows() as u64,
            accepted: inner.accepted.clone(),
            memory: serde_json::to_value(memory).map_err(foreign)?,
            points,
            log_density,
        })
    }

    /// Begins a round at free points.
    fn begin(
        &self,
        target: &dyn Target,
        map: Option<Map>,
        free: &Matrix,
        round: usize,
    ) -> Result<(Memory, State), Stop> {
        let places = free.iter_rows().map(|u| match &map {
            Some(map) => map.transported(u),
            None => u.to_vec(),
        });
        let places = Matrix::from_rows(free.columns(), places);
        let transported = Transported::new(target, map.as_ref());
        let mut inner = chains::start(&self.settings(round), &transported, places)?;
        let memory = Memory {
            step: 0,
            map,
            gathered: Vec::new(),
            points: inner.points.clone(),
            inner: inner.memory.take(),
        };
        Ok((memory, inner))
    }
}

impl Component for Transport {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        Settings { warm_up: self.warm_up, ..self.settings(0) }.check(complaints);
        if self.warm_up < SHORTEST_WARM_UP {
            complaints
                .at("warm_up")
                .say("too few steps to learn a map")
                .expected(format!("at least {SHORTEST_WARM_UP}"))
                .found(self.warm_up);
        }
        tree::check_depth(self.depth, complaints);
    }
}

impl Sampler for Transport {
    fn uses_gradient(&self) -> bool {
        true
    }

    fn steps_are_draws(&self) -> bool {
        true
    }

    fn plan(&self, _dimension: usize) -> Plan {
        Plan { chains: self.chains, steps: self.steps, warm_up: self.warm_up, ensemble: false }
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        chains::check_start(self.chains, target, &points)?;
        let free = Unconstrained::new(target);
        let places = Matrix::from_rows(points.columns(), points.iter_rows().map(|x| free.free(x)));
        if let Some(i) = target.log_density(&points).iter().position(|l| !l.is_finite()) {
            let chain = i + 1;
            let message = format!("chain {chain} starts where the posterior density is zero");
            return Err(Stop::new(message));
        }
        let (memory, inner) = self.begin(target, None, &places, 0)?;
        Self::outside(target, &memory, &inner, 0)
    }

    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        let mut memory: Memory = serde_json::from_value(state.memory.take()).map_err(foreign)?;
        let round = self.round(memory.step);
        let mut inner = State {
            points: memory.points.clone(),
            log_density: vec![0.0; self.chains],
            accepted: vec![false; self.chains],
            evaluations: 0,
            memory: memory.inner.take(),
        };
        let transported = Transported::new(target, memory.map.as_ref());
        chains::advance(
            &self.settings(round),
            &transported,
            &mut inner,
            stream,
            |flow, point, step, rng| tree::transition(flow, point, step, self.depth, rng),
        )?;
        let free: Vec<Vec<f64>> = inner.points.iter_rows().map(|z| transported.free(z)).collect();
        if self.gathers(memory.step, free[0].len()) {
            memory.gathered.extend(free.iter().cloned());
        }
        memory.step += 1;
        let mut evaluations = inner.evaluations;
        if round + 1 < ROUNDS && memory.step == self.end(round) {
            let map = self.learnt(&memory.gathered).or(memory.map);
            let places = Matrix::from_rows(free[0].len(), &free);
            let (next, started) = self.begin(target, map, &places, round + 1)?;
            memory = Memory { step: memory.step, ..next };
            let accepted = std::mem::take(&mut inner.accepted);
            evaluations += started.evaluations;
            inner = State { accepted, ..started };
        } else {
            memory.points.clone_from(&inner.points);
            memory.inner = inner.memory.take();
        }
        inner.evaluations = evaluations;
        *state = Self::outside(target, &memory, &inner, state.evaluations)?;
        Ok(())
    }

    fn statistics(&self, state: &State) -> Vec<Statistic> {
        told::statistics(&within(state), true)
    }

    fn doubts(&self, state: &State) -> Vec<String> {
        chains::doubts(&self.finished(), &within(state))
    }

    fn notes(&self, state: &State) -> Vec<String> {
        let mut notes = chains::notes(&self.finished(), &within(state));
        let memory = serde_json::from_value::<Memory>(state.memory.clone());
        notes.extend(memory.ok().map(|memory| match &memory.map {
            Some(map) => format!(
                "in the learnt coordinates {} unknowns depend on others in place and scale, {} in place only, {} not at all",
                map.count(Form::Curved),
                map.count(Form::Linear),
                map.count(Form::Constant)
            ),
            None => "no map was learnt: in the warm-up the chains disagreed, or had no scatter".to_owned(),
        }));
        notes
    }

    fn facts(&self) -> Vec<Fact> {
        let mut facts = Settings { warm_up: self.warm_up, ..self.settings(0) }.facts();
        facts.push(Fact::new("largest depth", self.depth));
        facts
    }
}

impl Transport {
    /// Settings of the last round, whose trajectories are counted after its own warm-up.
    fn finished(&self) -> Settings {
        let last = self.settings(ROUNDS - 1);
        Settings { steps: self.steps - self.end(ROUNDS - 2), ..last }
    }
}

/// The state of the trajectories inside a state of this sampler.
fn within(state: &State) -> State {
    State { memory: state.memory.get("inner").cloned().unwrap_or_default(), ..state.clone() }
}

lacuna::register!(Sampler, "transport", Transport, aliases: ["neutra"]);

#[cfg(test)]
mod tests;
