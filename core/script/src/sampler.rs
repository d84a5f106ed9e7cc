//! Samplers in Python.

use lacuna::math::random::Stream;
use lacuna::matrix::Matrix;
use lacuna::plugin::sampler::{Harvest, Plan, Sampler, Start, State};
use lacuna::plugin::{Fact, Target};
use lacuna::run::Stop;
use lacuna_abi::Refusal;
use lacuna_abi::check::{densities_only, finite_only, shaped};
use lacuna_abi::wire::HarvestAbout;
use serde::Deserialize;
use serde_json::{Value as Json, json};

use crate::message::Message;
use crate::object::{Call, Plugin, answer, matrices, row};

/// Answer of a step beside its numbers.
#[derive(Deserialize)]
struct Stepped {
    evaluations: u64,
    memory: Json,
}

/// Properties of all runs of a sampler.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Traits {
    uses_starts: Option<bool>,
    uses_gradient: bool,
    start_where: Option<Start>,
    steps_are_draws: Option<bool>,
}

impl Plugin {
    fn traits(&self) -> Traits {
        let asked = || answer(&self.0.ask(&Call::new("traits", &[]))?);
        self.0.or_fault(asked(), Traits::default)
    }

    fn planned(&self, dimension: usize) -> Result<Plan, Refusal> {
        let about = json!({ "dimension": dimension });
        let plan: Plan = answer(&self.0.ask(&Call::new("plan", &[]).about(about))?)?;
        let Plan { chains, steps, .. } = plan;
        let draws = chains.checked_mul(steps).and_then(|draws| draws.checked_mul(dimension.max(1)));
        if chains == 0 || steps == 0 || draws.is_none_or(|draws| draws > isize::MAX as usize / 8) {
            return Err(Refusal::stop(format!("`plan` plans {chains} chains of {steps} steps")));
        }
        Ok(plan)
    }

    /// A call about a state; `give` receives it with its numbers.
    fn of_state<T>(
        what: &'static str,
        state: &State,
        give: impl FnOnce(Call<'_>) -> Result<T, Refusal>,
    ) -> Result<T, Refusal> {
        let accepted: Vec<f64> = state.accepted.iter().map(|&a| f64::from(u8::from(a))).collect();
        let (log_density, accepted) = (row(&state.log_density), row(&accepted));
        let given = [&state.points, &log_density, &accepted];
        give(Call::new(what, &given).about(json!({
            "memory": state.memory, "dimension": state.points.columns(),
        })))
    }

    fn taken(
        message: Message,
        what: &'static str,
        (chains, dimension, before): (usize, usize, u64),
    ) -> Result<State, Refusal> {
        let Stepped { evaluations, memory } = answer(&message)?;
        let [points, log_density, accepted] = matrices(message)?;
        shaped(what, &points, chains, dimension)?;
        shaped(what, &log_density, 1, chains)?;
        shaped(what, &accepted, 1, chains)?;
        finite_only(what, points.as_slice())?;
        densities_only(what, log_density.as_slice())?;
        Ok(State {
            points,
            log_density: log_density.into_vec(),
            accepted: accepted.as_slice().iter().map(|&a| a != 0.0).collect(),
            evaluations: before + evaluations,
            memory,
        })
    }

    fn stepped(
        &self,
        target: &dyn Target,
        state: &State,
        stream: &Stream,
    ) -> Result<State, Refusal> {
        let message = Self::of_state("step", state, |mut call| {
            call.about.insert("key".to_owned(), json!(stream.key()));
            self.0.ask(&Call { target: Some(target), ..call })
        })?;
        let (chains, dimension) = (state.points.rows(), state.points.columns());
        Self::taken(message, "step", (chains, dimension, state.evaluations))
    }

    fn harvested(
        &self,
        target: &dyn Target,
        state: &State,
        stream: &Stream,
    ) -> Result<Harvest, Refusal> {
        let message = Self::of_state("harvest", state, |mut call| {
            call.about.insert("key".to_owned(), json!(stream.key()));
            self.0.ask(&Call { target: Some(target), ..call })
        })?;
        let HarvestAbout { effective_size, evidence, doubts, facts } = answer(&message)?;
        let [points, log_density] = matrices(message)?;
        shaped("harvest", &points, points.rows(), target.dimension())?;
        shaped("harvest", &log_density, 1, points.rows())?;
        finite_only("harvest", points.as_slice())?;
        densities_only("harvest", log_density.as_slice())?;
        let log_density = log_density.into_vec();
        Ok(Harvest { points, log_density, effective_size, evidence, doubts, facts })
    }
}

impl Sampler for Plugin {
    fn plan(&self, dimension: usize) -> Plan {
        let nothing = || Plan { chains: 1, steps: 0, warm_up: 0, ensemble: false };
        self.0.or_fault(self.planned(dimension), nothing)
    }

    fn uses_starts(&self) -> bool {
        self.traits().uses_starts.unwrap_or(true)
    }

    fn uses_gradient(&self) -> bool {
        self.traits().uses_gradient
    }

    fn start_where(&self) -> Start {
        self.traits().start_where.unwrap_or(Start::Map)
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        let (chains, dimension) = (points.rows(), points.columns());
        let started = || {
            let expected = self.planned(dimension)?.chains;
            if chains != expected {
                let message = format!("expected {expected} starting points, found {chains}");
                return Err(Refusal::stop(message));
            }
            finite_only("the starting points", points.as_slice())?;
            let given = [&points];
            let call = Call::new("start", &given).about(json!({ "dimension": dimension }));
            let message = self.0.ask(&Call { target: Some(target), ..call })?;
            let state = Self::taken(message, "start", (chains, dimension, 0))?;
            match state.log_density.iter().find(|density| !density.is_finite()) {
                Some(density) => {
                    let message = format!("the log density of a starting point is {density}");
                    Err(Refusal::stop(message))
                }
                None => Ok(state),
            }
        };
        self.0.or_stop(started())
    }

    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        *state = self.0.or_stop(self.stepped(target, state, stream))?;
        Ok(())
    }

    fn finished(&self, state: &State) -> bool {
        if !self.0.has("finished") {
            return false;
        }
        let asked = Self::of_state("finished", state, |call| answer(&self.0.ask(&call)?));
        self.0.or_fault(asked, || true)
    }

    fn steps_are_draws(&self) -> bool {
        !self.0.has("harvest") && self.traits().steps_are_draws.unwrap_or(false)
    }

    fn harvest(
        &self,
        target: &dyn Target,
        state: &State,
        stream: &Stream,
    ) -> Result<Option<Harvest>, Stop> {
        if !self.0.has("harvest") {
            return Ok(None);
        }
        self.0.or_stop(self.harvested(target, state, stream)).map(Some)
    }

    fn facts(&self) -> Vec<Fact> {
        if !self.0.has("facts") {
            return Vec::new();
        }
        let asked = || answer(&self.0.ask(&Call::new("facts", &[]))?);
        self.0.or_fault(asked(), Vec::new)
    }
}
