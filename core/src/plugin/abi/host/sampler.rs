//! Samplers of libraries.

use super::Plugin;
use super::object::{densities_only, finite_only, marks, shaped};
use super::plugin::{facts, optional, texts};
use super::target::ServedTarget;
use crate::data::Statistic;
use crate::data::statistics::Kind;
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::plugin::Fact;
use crate::plugin::abi::table::{self, Key, SamplerFunctions, Text};
use crate::plugin::abi::wire::{HarvestAbout, StatisticAbout};
use crate::plugin::abi::{Refusal, Reply};
use crate::plugin::sampler::{Harvest, Plan, Sampler, State, Target};
use crate::run::Stop;
use crate::study::file::Start;

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

    /// What the other side is given: good for as long as this value stays where it is.
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
        let (ask, this, to) = (self.object.functions.plan, self.object.this, &raw mut plan);
        // SAFETY: the function belongs to the plugin, and the place for the plan is ours.
        self.object.demand("plan", |a| optional(ask, |f| unsafe { f(this, dimension, to, a) }))?;
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
        let (target, to) = (served.table(), &raw mut state);
        let (ask, this) = (self.object.functions.start, self.object.this);
        // SAFETY: the function belongs to the plugin; density and state are there until it returns.
        let call = |a| optional(ask, |f| unsafe { f(this, &raw const target, to, a) });
        let reply = self.object.demand("start", call)?;
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
        let (target, to, key) = (served.table(), &raw mut state, Key { words: stream.key() });
        let (ask, this) = (self.object.functions.step, self.object.this);
        // SAFETY: as in `begun`.
        let call = |a| optional(ask, |f| unsafe { f(this, &raw const target, to, key, a) });
        let reply = self.object.demand("step", call)?;
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
        let (target, key) = (served.table(), Key { words: stream.key() });
        let (ask, this) = (self.object.functions.harvest, self.object.this);
        // SAFETY: as in `begun`.
        let call =
            |a| optional(ask, |f| unsafe { f(this, &raw const target, &raw const state, key, a) });
        let Some(reply) = self.object.ask("harvest", call)? else { return Ok(None) };
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
        let (ask, this) = (self.object.functions.start_where, self.object.this);
        // SAFETY: the function belongs to the plugin.
        let call = |a| optional(ask, |f| unsafe { f(this, a) });
        let Some(reply) = self.object.ask("start_where", call)? else { return Ok(Start::Map) };
        let text = reply.string();
        serde_json::from_value(text.as_str().into())
            .map_err(|error| Refusal::stop(format!("`start_where` answers no start: {error}")))
    }

    fn told(&self, state: &State) -> Result<Vec<Statistic>, Refusal> {
        let Some(ask) = self.object.functions.statistics else { return Ok(Vec::new()) };
        let mut handed = Handed::of(state)?;
        let (given, this) = (handed.table(), self.object.this);
        // SAFETY: as in `begun`.
        let call = |a| unsafe { ask(this, &raw const given, a) };
        let Some(reply) = self.object.ask("statistics", call)? else { return Ok(Vec::new()) };
        let about: Vec<StatisticAbout> = reply.json()?;
        let [values] = reply.matrices()?;
        shaped("statistics", &values, about.len(), state.points.rows())?;
        let all = about.into_iter().zip(values.iter_rows());
        let all = all.map(|(about, row)| about.with(row.to_vec())).collect::<Vec<_>>();
        sound_statistics(&all).map(|()| all)
    }

    /// What is said of a run that ended in a state.
    fn said(
        &self,
        what: &'static str,
        state: &State,
        ask: Option<
            unsafe extern "C" fn(
                *mut std::ffi::c_void,
                *const table::State,
                *const table::Answer,
            ) -> i32,
        >,
    ) -> Vec<String> {
        let said = || {
            let mut handed = Handed::of(state)?;
            let (state, this) = (handed.table(), self.object.this);
            // SAFETY: as in `begun`.
            let call = |a| optional(ask, |f| unsafe { f(this, &raw const state, a) });
            texts(self.object.ask(what, call)?)
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
        let (ask, this) = (self.object.functions.uses_starts, self.object.this);
        // SAFETY: the function belongs to the plugin, and the place for the mark is there until it returns.
        let call = |to, a| optional(ask, |f| unsafe { f(this, to, a) });
        self.object.or_fault(self.object.mark("uses_starts", true, call), || true)
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
        let Some(ask) = self.object.functions.finished else { return false };
        let handed = Handed::of(state).map(|mut handed| {
            let state = handed.table();
            // SAFETY: the function belongs to the plugin; the state is there until it returns.
            unsafe { ask(self.object.this, &raw const state) == 1 }
        });
        self.object.or_fault(handed, || true)
    }

    fn steps_are_draws(&self) -> bool {
        let (ask, this) = (self.object.functions.steps_are_draws, self.object.this);
        // SAFETY: as in `uses_starts`.
        let call = |to, a| optional(ask, |f| unsafe { f(this, to, a) });
        self.object.or_fault(self.object.mark("steps_are_draws", false, call), || false)
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
        self.said("doubts", state, self.object.functions.doubts)
    }

    fn notes(&self, state: &State) -> Vec<String> {
        self.said("notes", state, self.object.functions.notes)
    }

    fn facts(&self) -> Vec<Fact> {
        let (ask, this) = (self.object.functions.facts, self.object.this);
        // SAFETY: the function belongs to the plugin.
        let reply = self.object.ask("facts", |a| optional(ask, |f| unsafe { f(this, a) }));
        self.object.or_fault(reply.and_then(facts), Vec::new)
    }
}
