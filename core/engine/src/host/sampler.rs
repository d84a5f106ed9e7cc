//! Samplers of libraries.

use lacuna::data::Statistic;
use lacuna::data::statistics::Kind;
use lacuna::math::random::Stream;
use lacuna::plugin::sampler::{Harvest, Plan, Sampler, Start, State};
use lacuna::plugin::{Fact, Target};
use lacuna::run::Stop;
use lacuna_abi::check::{densities_only, finite_only, marks, shaped};
use lacuna_abi::object::{Asked, mark};
use lacuna_abi::table::{self, SamplerFunctions, Text};
use lacuna_abi::wire::{HarvestAbout, StatisticAbout};
use lacuna_abi::{Refusal, Reply};
use lacuna_linalg::Matrix;

use super::Plugin;
use super::target::ServedTarget;

/// A state as it is handed over.
struct Handed {
    points: Matrix,
    log_density: Vec<f64>,
    accepted: Vec<u8>,
    memory: String,
    evaluations: u64,
}

impl Handed {
    fn of(state: &State) -> Result<Self, Refusal> {
        let memory = &state.memory;
        Ok(Self {
            points: state.points.clone(),
            log_density: state.log_density.clone(),
            accepted: state.accepted.iter().map(|&a| u8::from(a)).collect(),
            memory: if memory.is_null() { String::new() } else { serde_json::to_string(memory)? },
            evaluations: state.evaluations,
        })
    }

    /// The struct that is handed to the other side: valid for as long as this value stays where it is.
    fn table(&mut self) -> table::State {
        table::State {
            size: size_of::<table::State>(),
            chains: self.points.rows(),
            dimension: self.points.columns(),
            points: self.points.as_mut_slice().as_mut_ptr(),
            log_density: self.log_density.as_mut_ptr(),
            accepted: self.accepted.as_mut_ptr(),
            evaluations: self.evaluations,
            memory: Text::of(&self.memory),
        }
    }

    /// The state that a call left; a memory that it did not write is that of `before`.
    fn taken(
        self,
        what: &'static str,
        evaluations: u64,
        reply: &Reply,
        before: serde_json::Value,
    ) -> Result<State, Refusal> {
        densities_only(what, &self.log_density)?;
        finite_only(what, self.points.as_slice())?;
        Ok(State {
            points: self.points,
            log_density: self.log_density,
            accepted: marks(what, &self.accepted)?,
            evaluations,
            memory: reply.json_if_any()?.unwrap_or(before),
        })
    }
}

impl Plugin<SamplerFunctions> {
    fn planned(&self, dimension: usize) -> Result<Plan, Refusal> {
        let mut plan = table::Plan { chains: 0, steps: 0, warm_up: 0, ensemble: 0 };
        // SAFETY: there is a place for one plan.
        unsafe { self.object.plan(dimension, &raw mut plan) }.demand()?;
        let table::Plan { chains, steps, warm_up, ensemble } = plan;
        if chains == 0 || steps == 0 {
            let message = format!("`plan` plans {chains} chains of {steps} steps");
            return Err(Refusal::stop(message));
        }
        // What no memory holds is no number of draws.
        let draws = chains.checked_mul(steps).and_then(|draws| draws.checked_mul(dimension.max(1)));
        if draws.is_none_or(|numbers| numbers > isize::MAX as usize / size_of::<f64>()) {
            let message =
                format!("`plan` plans {chains} chains of {steps} steps, more than there can be");
            return Err(Refusal::stop(message));
        }
        Ok(Plan { chains, steps, warm_up, ensemble: marks("plan", &[ensemble])?[0] })
    }

    fn begun(&self, target: &dyn Target, points: Matrix) -> Result<State, Refusal> {
        let chains = points.rows();
        let mut handed = Handed {
            points,
            log_density: vec![f64::NAN; chains],
            accepted: vec![0; chains],
            memory: String::new(),
            evaluations: 0,
        };
        let (mut state, served) = (handed.table(), ServedTarget(target));
        let target = served.table();
        // SAFETY: density and state are there until the call returns.
        let reply = unsafe { self.object.start(&raw const target, &raw mut state) }.demand()?;
        handed.taken("start", state.evaluations, &reply, serde_json::Value::Null)
    }

    fn stepped(
        &self,
        target: &dyn Target,
        before: &State,
        stream: &Stream,
    ) -> Result<State, Refusal> {
        let mut handed = Handed::of(before)?;
        let (mut state, served) = (handed.table(), ServedTarget(target));
        let target = served.table();
        // SAFETY: as in `begun`.
        let asked = unsafe { self.object.step(&raw const target, &raw mut state, stream) };
        let reply = asked.demand()?;
        handed.taken("step", state.evaluations, &reply, before.memory.clone())
    }

    fn harvested(
        &self,
        target: &dyn Target,
        state: &State,
        stream: &Stream,
    ) -> Result<Option<Harvest>, Refusal> {
        let mut handed = Handed::of(state)?;
        let (state, served) = (handed.table(), ServedTarget(target));
        let target = served.table();
        // SAFETY: as in `begun`.
        let asked = unsafe { self.object.harvest(&raw const target, &raw const state, stream) };
        let Some(reply) = asked.if_any()? else { return Ok(None) };
        let about: HarvestAbout = reply.json()?;
        let [points, log_density] = reply.matrices()?;
        shaped("harvest", &log_density, 1, points.rows())?;
        shaped("harvest", &points, points.rows(), served.0.dimension())?;
        finite_only("harvest", points.as_slice())?;
        densities_only("harvest", log_density.as_slice())?;
        Ok(Some(Harvest {
            points,
            log_density: log_density.into_vec(),
            effective_size: about.effective_size,
            evidence: about.evidence,
            doubts: about.doubts,
            facts: about.facts,
        }))
    }

    fn chosen_start(&self) -> Result<Start, Refusal> {
        // SAFETY: nothing is written.
        let asked = unsafe { self.object.start_where() };
        let Some(reply) = asked.if_any()? else { return Ok(Start::Map) };
        let text = reply.string();
        serde_json::from_value(text.as_str().into())
            .map_err(|error| Refusal::stop(format!("`start_where` answers no start: {error}")))
    }

    fn told(&self, state: &State) -> Result<Vec<Statistic>, Refusal> {
        let mut handed = Handed::of(state)?;
        let given = handed.table();
        // SAFETY: as in `begun`.
        let asked = unsafe { self.object.statistics(&raw const given) };
        let Some(reply) = asked.if_any()? else { return Ok(Vec::new()) };
        let about: Vec<StatisticAbout> = reply.json()?;
        let [values] = reply.matrices()?;
        shaped("statistics", &values, about.len(), state.points.rows())?;
        let all = about.into_iter().zip(values.iter_rows());
        let all = all.map(|(about, row)| about.with(row.to_vec())).collect::<Vec<_>>();
        sound_statistics(&all).map(|()| all)
    }

    /// The remarks of a sampler on a run that ended in a state.
    fn said(&self, state: &State, ask: impl FnOnce(*const table::State) -> Asked) -> Vec<String> {
        let said = || {
            let mut handed = Handed::of(state)?;
            let state = handed.table();
            ask(&raw const state).json_if_any()
        };
        self.object.or_fault(said(), Vec::new)
    }
}

/// Complains of statistics without a name of their own, and of values that are not of their kind; what is not a number
/// is a value that is not there.
fn sound_statistics(all: &[Statistic]) -> Result<(), Refusal> {
    for (i, Statistic { name, kind, values }) in all.iter().enumerate() {
        if name.is_empty() || all[..i].iter().any(|other| other.name == *name) {
            let message = format!("statistic {} is called `{name}`", i + 1);
            return Err(Refusal::stop(format!("{message}, expected a name of its own")));
        }
        let (fits, expected): (fn(f64) -> bool, _) = match kind {
            Kind::Flag => (|x| x == 0.0 || x == 1.0, "0 or 1"),
            Kind::Count => (|x| x >= 0.0 && x.fract() == 0.0, "a whole number"),
            Kind::Number => (|_| true, "a number"),
        };
        if let Some(x) = values.iter().find(|x| !x.is_nan() && !fits(**x)) {
            let message = format!("`statistics` gives {x} as `{name}`, expected {expected}");
            return Err(Refusal::stop(message));
        }
    }
    Ok(())
}

impl Sampler for Plugin<SamplerFunctions> {
    fn plan(&self, dimension: usize) -> Plan {
        let nothing = || Plan { chains: 1, steps: 0, warm_up: 0, ensemble: false };
        self.object.or_fault(self.planned(dimension), nothing)
    }

    fn uses_starts(&self) -> bool {
        // SAFETY: there is a place for one mark.
        let uses = mark(true, |to| unsafe { self.object.uses_starts(to) });
        self.object.or_fault(uses, || true)
    }

    fn start_where(&self) -> Start {
        self.object.or_fault(self.chosen_start(), || Start::Map)
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        self.object.or_stop(self.begun(target, points))
    }

    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        *state = self.object.or_stop(self.stepped(target, state, stream))?;
        Ok(())
    }

    fn finished(&self, state: &State) -> bool {
        if self.object.functions.finished.is_none() {
            return false;
        }
        let handed = Handed::of(state).map(|mut handed| {
            let state = handed.table();
            // SAFETY: as in `begun`.
            unsafe { self.object.finished(&raw const state) == Some(1) }
        });
        self.object.or_fault(handed, || true)
    }

    fn steps_are_draws(&self) -> bool {
        // SAFETY: there is a place for one mark.
        let draws = mark(false, |to| unsafe { self.object.steps_are_draws(to) });
        self.object.or_fault(draws, || false)
    }

    fn harvest(
        &self,
        target: &dyn Target,
        state: &State,
        stream: &Stream,
    ) -> Result<Option<Harvest>, Stop> {
        self.object.or_stop(self.harvested(target, state, stream))
    }

    fn statistics(&self, state: &State) -> Vec<Statistic> {
        self.object.or_fault(self.told(state), Vec::new)
    }

    fn doubts(&self, state: &State) -> Vec<String> {
        // SAFETY: as in `begun`.
        self.said(state, |state| unsafe { self.object.doubts(state) })
    }

    fn notes(&self, state: &State) -> Vec<String> {
        // SAFETY: as in `begun`.
        self.said(state, |state| unsafe { self.object.notes(state) })
    }

    fn facts(&self) -> Vec<Fact> {
        // SAFETY: nothing is written.
        self.object.or_fault(unsafe { self.object.facts() }.json_if_any(), Vec::new)
    }
}
