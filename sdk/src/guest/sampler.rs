//! Samplers of a library.

use lacuna::math::random::Stream;
use lacuna::matrix::Matrix;
use lacuna::plugin::sampler::{Sampler, State};
use lacuna_abi::Refusal;
use lacuna_abi::argument::{Lent, Space};
use lacuna_abi::guard::{Done, Out, fill};
use lacuna_abi::table::{Plan, ServeSampler, State as Table, Target};
use lacuna_abi::wire::{HarvestAbout, StatisticAbout};
use serde_json::Value;

use super::target::TargetView;
use super::{Authored, Plugin};

/// Copies a state.
///
/// # Safety
/// The pointer leads to a state whose buffers have the sizes that it says.
unsafe fn read(state: *const Table) -> Result<State, Refusal> {
    // SAFETY: as the caller promises.
    let state = unsafe { &*state };
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

/// The state that a call is given to look at.
fn given(state: Lent<'_, Table>) -> Result<State, Refusal> {
    // SAFETY: the table gives a state with its buffers.
    unsafe { read(state.one()) }
}

/// The density that a call is given.
fn density(target: Lent<'_, Target>) -> Result<TargetView<'_>, Refusal> {
    // SAFETY: the table gives a density, which is there for the time of the call.
    unsafe { TargetView::new(target.one()) }
}

/// Writes a state back; its memory only where it is another one than `before`.
///
/// # Safety
/// As for [`read`].
unsafe fn write(table: *mut Table, state: &State, before: &Value, out: &Out) -> Done {
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

impl<T: Sampler + Authored> ServeSampler for Plugin<T> {
    fn plan(&self, dimension: usize, made: Space<'_, Plan>, _: &Out) -> Done {
        let plan = self.0.plan(dimension);
        let (chains, steps, warm_up) = (plan.chains, plan.steps, plan.warm_up);
        // SAFETY: the caller gives a place for one plan.
        unsafe { made.put(Plan { chains, steps, warm_up, ensemble: u8::from(plan.ensemble) }) };
        Ok(())
    }

    fn start(&self, target: Lent<'_, Target>, state: Space<'_, Table>, out: &Out) -> Done {
        // SAFETY: the table gives a state with its buffers.
        let (view, given) = unsafe { (density(target)?, read(state.pointer())?) };
        let begun = self.0.start(&view, given.points)?;
        view.sound()?;
        // SAFETY: as above.
        unsafe { write(state.pointer(), &begun, &Value::Null, out) }
    }

    fn step(
        &self,
        target: Lent<'_, Target>,
        state: Space<'_, Table>,
        key: Stream,
        out: &Out,
    ) -> Done {
        // SAFETY: as in `start`.
        let (view, mut own) = unsafe { (density(target)?, read(state.pointer())?) };
        let before = own.memory.clone();
        self.0.step(&view, &mut own, &key)?;
        view.sound()?;
        // SAFETY: as in `start`.
        unsafe { write(state.pointer(), &own, &before, out) }
    }

    fn finished(&self, state: Lent<'_, Table>) -> i32 {
        given(state).map_or(0, |state| i32::from(self.0.finished(&state)))
    }

    fn harvest(
        &self,
        target: Lent<'_, Target>,
        state: Lent<'_, Table>,
        key: Stream,
        out: &Out,
    ) -> Done {
        let view = density(target)?;
        let harvest = self.0.harvest(&view, &given(state)?, &key)?;
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
    }

    fn doubts(&self, state: Lent<'_, Table>, out: &Out) -> Done {
        out.json(&self.0.doubts(&given(state)?))
    }

    fn notes(&self, state: Lent<'_, Table>, out: &Out) -> Done {
        out.json(&self.0.notes(&given(state)?))
    }

    fn facts(&self, out: &Out) -> Done {
        out.json(&self.0.facts())
    }

    fn uses_starts(&self, uses: Space<'_, u8>, _: &Out) -> Done {
        // SAFETY: the caller gives a place for one mark.
        unsafe { uses.put(u8::from(self.0.uses_starts())) };
        Ok(())
    }

    fn start_where(&self, out: &Out) -> Done {
        let start = serde_json::to_value(self.0.start_where())?;
        out.text(start.as_str().unwrap_or_default());
        Ok(())
    }

    fn steps_are_draws(&self, draws: Space<'_, u8>, _: &Out) -> Done {
        // SAFETY: the caller gives a place for one mark.
        unsafe { draws.put(u8::from(self.0.steps_are_draws())) };
        Ok(())
    }

    fn statistics(&self, state: Lent<'_, Table>, out: &Out) -> Done {
        let state = given(state)?;
        let all = self.0.statistics(&state);
        if all.is_empty() {
            return Err(Refusal::absent());
        }
        out.numbers(&Matrix::from_rows(state.points.rows(), all.iter().map(|one| &one.values)));
        out.json(&all.iter().map(StatisticAbout::from).collect::<Vec<_>>())
    }
}
