//! Tasks of a stage as its cases: consecutive tasks are one case.

use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use lacuna::run::tasks::{MakeTask, Spread, TaskDone};
use lacuna::run::{Observer, Stop, files};
use lacuna_run::Stage;
use lacuna_run::work::Then;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{Cases, Outcome, Visit, runner};
use crate::study::Study;

/// Number of cases into which the tasks of a call are divided at most: an executor packs them further.
const MOST_CASES: usize = 200;

/// Values of the tasks of a case.
#[derive(Serialize, Deserialize)]
#[serde(transparent)]
struct Values(Vec<Value>);

impl Outcome for Values {}

/// The cases of one call of [`Spread::compute`].
#[derive(Clone, Copy)]
struct Call {
    /// Number of the first case: those of the calls before precede it.
    first: usize,
    tasks: usize,
    /// Number of tasks of each case but the last.
    size: usize,
}

impl Call {
    /// The next call, with so many tasks.
    fn next(begun: &AtomicUsize, tasks: usize) -> Self {
        let size = tasks.div_ceil(MOST_CASES).max(1);
        let first = begun.fetch_add(tasks.div_ceil(size), Ordering::Relaxed);
        Self { first, tasks, size }
    }

    fn cases(&self) -> Range<usize> {
        self.first..self.first + self.tasks.div_ceil(self.size)
    }

    fn tasks_of(&self, case: usize) -> Range<usize> {
        let start = (case - self.first) * self.size;
        start..self.tasks.min(start + self.size)
    }

    fn make(&self, case: usize, make: &MakeTask<'_>) -> Result<Values, Stop> {
        if !self.cases().contains(&case) {
            return Err(Stop::new(format!("no case {case} among {:?}", self.cases())));
        }
        self.tasks_of(case).map(make).collect::<Result<_, _>>().map(Values)
    }

    /// Reads the values of a finished case; `None` if it is not finished.
    fn read(&self, folder: &Path, case: usize) -> Option<Values> {
        let values: Values = files::read_json(&folder.join(runner::file_of(case))).ok()?;
        (values.0.len() == self.tasks_of(case).len()).then_some(values)
    }
}

/// Tasks of a stage, computed by the executor of `[cases]`. Cases of an earlier attempt are not computed again.
pub struct Spreading<'a> {
    study: &'a Study,
    stage: Stage,
    folder: &'a Path,
    inputs: &'a str,
    observer: &'a dyn Observer,
    begun: AtomicUsize,
}

impl<'a> Spreading<'a> {
    /// Prepares the cases of a stage in its folder; `inputs` is the hash of everything on which the tasks depend.
    pub fn new(
        study: &'a Study,
        stage: Stage,
        folder: &'a Path,
        inputs: &'a str,
        observer: &'a dyn Observer,
    ) -> Self {
        Self { study, stage, folder, inputs, observer, begun: AtomicUsize::new(0) }
    }
}

impl Spread for Spreading<'_> {
    fn compute(
        &self,
        count: usize,
        make: &MakeTask<'_>,
        done: &TaskDone<'_>,
    ) -> Result<Vec<Value>, Stop> {
        let call = Call::next(&self.begun, count);
        let tell = |case: usize| call.tasks_of(case).for_each(done);
        let cases: Vec<Option<Values>> =
            call.cases().map(|case| call.read(self.folder, case)).collect();
        let has = |case: &usize| cases[case - call.first].is_some();
        call.cases().filter(has).for_each(tell);
        let missing: Vec<usize> = call.cases().filter(|case| !has(case)).collect();
        let cases = Mutex::new(cases);
        let all = Cases {
            study: self.study,
            stage: self.stage,
            folder: self.folder,
            inputs: self.inputs,
            asked: json!(call.first),
        };
        let note = |case: usize, values: Values| {
            cases.lock().unwrap_or_else(PoisonError::into_inner)[case - call.first] = Some(values);
            tell(case);
            Ok(())
        };
        all.compute(&missing, &|case| call.make(case, make), &note, self.observer)?;
        let cases = cases.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(cases.into_iter().flatten().flat_map(|values| values.0).collect())
    }
}

/// Tasks of the call for which a process was asked, in that process.
pub struct Visiting<'a> {
    visit: &'a Visit,
    /// Number of the first case of that call.
    first: usize,
    then: Mutex<Then<'a>>,
    begun: AtomicUsize,
    served: Mutex<Option<Result<(), Stop>>>,
}

impl<'a> Visiting<'a> {
    /// Hands the cases of the call over to `then`, when the computation comes to it.
    pub fn new(visit: &'a Visit, then: Then<'a>) -> Result<Self, Stop> {
        let first = visit.asked()?;
        let served = Mutex::new(None);
        Ok(Self { visit, first, then: Mutex::new(then), begun: AtomicUsize::new(0), served })
    }

    /// The end of the visit, given that of the computation, which stops where its cases have been served.
    pub fn end<T>(self, ended: Result<T, Stop>) -> Result<(), Stop> {
        let served = self.served.into_inner().unwrap_or_else(PoisonError::into_inner);
        served.unwrap_or_else(|| {
            ended?;
            Err(Stop::new(format!("there is no case {} here", self.first)))
        })
    }
}

impl Spread for Visiting<'_> {
    fn compute(
        &self,
        count: usize,
        make: &MakeTask<'_>,
        _: &TaskDone<'_>,
    ) -> Result<Vec<Value>, Stop> {
        let call = Call::next(&self.begun, count);
        if call.first != self.first {
            let values = |case: usize| {
                let lost = || Stop::new(format!("case {case} of a call before has no outcome"));
                call.read(self.visit.folder(), case).ok_or_else(lost)
            };
            let before: Vec<Values> = call.cases().map(values).collect::<Result<_, _>>()?;
            return Ok(before.into_iter().flat_map(|values| values.0).collect());
        }
        let mut then = self.then.lock().unwrap_or_else(PoisonError::into_inner);
        let served = self.visit.hand_over(&|case| call.make(case, make), &mut **then);
        *self.served.lock().unwrap_or_else(PoisonError::into_inner) = Some(served);
        Err(Stop::new("the cases have been served"))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn every_task_of_every_call_is_in_one_case() {
        let begun = AtomicUsize::new(0);
        let mut next = 0;
        for tasks in [1, 7, 199, 200, 201, 1000, 12_345] {
            let call = Call::next(&begun, tasks);
            assert_eq!(call.first, next);
            let cases = call.cases();
            next = cases.end;
            assert!((1..=MOST_CASES).contains(&cases.len()), "{tasks}: {cases:?}");
            let all: Vec<usize> = cases.flat_map(|case| call.tasks_of(case)).collect();
            assert!(all.into_iter().eq(0..tasks), "{tasks}");
        }
        let call = Call::next(&begun, 3);
        let make = |task| Ok(json!(task));
        assert_eq!(call.make(call.first + 2, &make).unwrap().0, [json!(2)]);
        assert!(call.make(call.first + 3, &make).is_err());
        assert!(call.make(call.first - 1, &make).is_err());
    }
}
