//! Samplers of a library.

use std::ffi::c_void;

use serde_json::Value;

use super::component::{Authored, Components, Export};
use super::target::TargetView;
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::plugin::abi::Refusal;
use crate::plugin::abi::guard::{Out, fill, guard, guard_number, mark, object};
use crate::plugin::abi::table::{
    Answer, ComponentFunctions, Key, Plan, SamplerFunctions, State as Table, Target,
};
use crate::plugin::abi::wire::{HarvestAbout, StatisticAbout};
use crate::plugin::sampler::{Sampler, State};

impl<T: Sampler + Authored, const REVISION: u32> Export<T, REVISION> for dyn Sampler {
    const FUNCTIONS: *const c_void = std::ptr::from_ref(Functions::<T>::TABLE).cast();
    const COMPONENT: *const ComponentFunctions = Components::<T, REVISION>::FUNCTIONS;
}

struct Functions<T>(std::marker::PhantomData<T>);

impl<T: Sampler + Authored> Functions<T> {
    const TABLE: &'static SamplerFunctions = &SamplerFunctions {
        size: size_of::<SamplerFunctions>(),
        plan: Some(plan::<T>),
        start: Some(start::<T>),
        step: Some(step::<T>),
        finished: Some(finished::<T>),
        harvest: Some(harvest::<T>),
        doubts: Some(doubts::<T>),
        notes: Some(notes::<T>),
        facts: Some(facts::<T>),
        uses_starts: Some(uses_starts::<T>),
        start_where: Some(start_where::<T>),
        steps_are_draws: Some(steps_are_draws::<T>),
        statistics: Some(statistics::<T>),
    };
}

/// Copies a state.
///
/// # Safety
/// The buffers have the sizes that the struct says.
unsafe fn read(state: &Table) -> Result<State, Refusal> {
    let (chains, dimension) = (state.chains, state.dimension);
    // SAFETY: as the caller promises.
    let (points, log_density, accepted, memory) = unsafe {
        (
            std::slice::from_raw_parts(state.points, chains * dimension),
            std::slice::from_raw_parts(state.log_density, chains),
            std::slice::from_raw_parts(state.accepted, chains),
            state.memory.bytes(),
        )
    };
    let memory = if memory.is_empty() { Value::Null } else { serde_json::from_slice(memory)? };
    Ok(State {
        points: Matrix::from_vec(chains, dimension, points.to_vec()),
        log_density: log_density.to_vec(),
        accepted: accepted.iter().map(|&a| a != 0).collect(),
        evaluations: state.evaluations,
        memory,
    })
}

/// Writes a state back; its memory only where it is another one than `before`.
///
/// # Safety
/// As for [`read`].
unsafe fn write(
    table: *mut Table,
    state: &State,
    before: &Value,
    out: &Out,
) -> Result<(), Refusal> {
    // SAFETY: as the caller promises.
    unsafe {
        let (chains, dimension) = ((*table).chains, (*table).dimension);
        fill((*table).points, chains * dimension, state.points.as_slice())?;
        fill((*table).log_density, chains, &state.log_density)?;
        if state.accepted.len() != chains {
            return Err(Refusal::stop(
                "the state says of another number of chains whether they moved",
            ));
        }
        for (i, &accepted) in state.accepted.iter().enumerate() {
            *(*table).accepted.add(i) = u8::from(accepted);
        }
        (*table).evaluations = state.evaluations;
    }
    if state.memory == *before { Ok(()) } else { out.json(&state.memory) }
}

unsafe extern "C" fn plan<T: Sampler + Authored>(
    plugin: *mut c_void,
    dimension: usize,
    made: *mut Plan,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: the plugin that `create` made.
        let plan = unsafe { object::<T>(plugin) }.plan(dimension);
        let (chains, steps, warm_up) = (plan.chains, plan.steps, plan.warm_up);
        // SAFETY: the caller gives a place for one plan.
        unsafe { *made = Plan { chains, steps, warm_up, ensemble: u8::from(plan.ensemble) } };
        Ok(())
    })
}

unsafe extern "C" fn start<T: Sampler + Authored>(
    plugin: *mut c_void,
    target: *const Target,
    state: *mut Table,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: the plugin that `create` made; target and state are there for the time of the call.
        let (plugin, view, given) =
            unsafe { (object::<T>(plugin), TargetView::new(&*target)?, read(&*state)?) };
        let begun = plugin.start(&view, given.points)?;
        view.sound()?;
        // SAFETY: as above.
        unsafe { write(state, &begun, &Value::Null, out) }
    })
}

unsafe extern "C" fn step<T: Sampler + Authored>(
    plugin: *mut c_void,
    target: *const Target,
    state: *mut Table,
    key: Key,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `start`.
        let (plugin, view, mut own) =
            unsafe { (object::<T>(plugin), TargetView::new(&*target)?, read(&*state)?) };
        let before = own.memory.clone();
        plugin.step(&view, &mut own, &Stream::from_key(key.words))?;
        view.sound()?;
        // SAFETY: as above.
        unsafe { write(state, &own, &before, out) }
    })
}

unsafe extern "C" fn finished<T: Sampler + Authored>(
    plugin: *mut c_void,
    state: *const Table,
) -> i32 {
    guard_number(0, || {
        // SAFETY: as in `start`.
        let (plugin, state) = unsafe { (object::<T>(plugin), read(&*state)) };
        state.map_or(0, |state| i32::from(plugin.finished(&state)))
    })
}

unsafe extern "C" fn harvest<T: Sampler + Authored>(
    plugin: *mut c_void,
    target: *const Target,
    state: *const Table,
    key: Key,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `start`.
        let (plugin, view, state) =
            unsafe { (object::<T>(plugin), TargetView::new(&*target)?, read(&*state)?) };
        let harvest = plugin.harvest(&view, &state, &Stream::from_key(key.words))?;
        view.sound()?;
        let harvest = harvest.ok_or_else(Refusal::absent)?;
        out.numbers(&harvest.points);
        out.row(&harvest.log_density);
        out.json(&HarvestAbout {
            effective_size: harvest.effective_size,
            evidence: harvest.evidence,
            doubts: harvest.doubts,
            facts: harvest.facts,
        })
    })
}

/// Answers what a sampler says of a state.
///
/// # Safety
/// The plugin is one that `create` made, and the state is there.
unsafe fn of_state<T: Sampler + Authored>(
    plugin: *mut c_void,
    state: *const Table,
    answer: *const Answer,
    tell: fn(&T, &State) -> Vec<String>,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as the caller promises.
        let (plugin, state) = unsafe { (object::<T>(plugin), read(&*state)?) };
        out.json(&tell(plugin, &state))
    })
}

unsafe extern "C" fn doubts<T: Sampler + Authored>(
    plugin: *mut c_void,
    state: *const Table,
    answer: *const Answer,
) -> i32 {
    // SAFETY: as this function's caller promises.
    unsafe { of_state::<T>(plugin, state, answer, Sampler::doubts) }
}

unsafe extern "C" fn notes<T: Sampler + Authored>(
    plugin: *mut c_void,
    state: *const Table,
    answer: *const Answer,
) -> i32 {
    // SAFETY: as this function's caller promises.
    unsafe { of_state::<T>(plugin, state, answer, Sampler::notes) }
}

unsafe extern "C" fn facts<T: Sampler + Authored>(
    plugin: *mut c_void,
    answer: *const Answer,
) -> i32 {
    // SAFETY: the plugin that `create` made.
    guard(answer, |out| out.json(&unsafe { object::<T>(plugin) }.facts()))
}

unsafe extern "C" fn uses_starts<T: Sampler + Authored>(
    plugin: *mut c_void,
    uses: *mut u8,
    answer: *const Answer,
) -> i32 {
    // SAFETY: the plugin that `create` made, and a place for one mark.
    unsafe { mark(uses, answer, || object::<T>(plugin).uses_starts()) }
}

unsafe extern "C" fn start_where<T: Sampler + Authored>(
    plugin: *mut c_void,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: the plugin that `create` made.
        let start = serde_json::to_value(unsafe { object::<T>(plugin) }.start_where())?;
        out.text(start.as_str().unwrap_or_default());
        Ok(())
    })
}

unsafe extern "C" fn steps_are_draws<T: Sampler + Authored>(
    plugin: *mut c_void,
    draws: *mut u8,
    answer: *const Answer,
) -> i32 {
    // SAFETY: as in `uses_starts`.
    unsafe { mark(draws, answer, || object::<T>(plugin).steps_are_draws()) }
}

unsafe extern "C" fn statistics<T: Sampler + Authored>(
    plugin: *mut c_void,
    state: *const Table,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `start`.
        let (plugin, state) = unsafe { (object::<T>(plugin), read(&*state)?) };
        let all = plugin.statistics(&state);
        if all.is_empty() {
            return Err(Refusal::absent());
        }
        out.numbers(&Matrix::from_rows(state.points.rows(), all.iter().map(|one| &one.values)));
        out.json(&all.iter().map(StatisticAbout::from).collect::<Vec<_>>())
    })
}
