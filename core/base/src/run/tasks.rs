//! Tasks of a computation that do not depend on each other.

use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::Stop;

/// Computes the task with this number, as a JSON value.
pub type MakeTask<'a> = dyn Fn(usize) -> Result<Value, Stop> + Sync + 'a;

/// Hears that the task with this number is done; any thread may call it.
pub type TaskDone<'a> = dyn Fn(usize) + Sync + 'a;

/// Has tasks computed by other processes.
pub trait Spread: Sync {
    /// Returns the values of so many tasks in their order.
    ///
    /// # Errors
    /// The first error of a task; or the reason why tasks have no value.
    fn compute(
        &self,
        count: usize,
        make: &MakeTask<'_>,
        done: &TaskDone<'_>,
    ) -> Result<Vec<Value>, Stop>;
}

/// The place where tasks are computed that do not depend on each other, such as the searches of the outputs of a
/// surrogate: the threads of this process, or other processes. The values have the same bits.
#[derive(Clone, Copy, Default)]
pub struct Tasks<'a> {
    elsewhere: Option<&'a dyn Spread>,
}

impl<'a> Tasks<'a> {
    /// Tasks of the threads of this process.
    pub fn here() -> Self {
        Self::default()
    }

    /// Tasks of other processes.
    pub fn elsewhere(spread: &'a dyn Spread) -> Self {
        Self { elsewhere: Some(spread) }
    }

    /// Returns the values of so many tasks in their order; `done` hears of each as it ends.
    ///
    /// A process that computes some of the tasks begins the same computation and follows it to this call, with the
    /// values of the calls before: what precedes it must not depend on anything else.
    ///
    /// # Errors
    /// The first error of a task; or the reason why tasks have no value.
    pub fn map<T: Serialize + DeserializeOwned + Send>(
        &self,
        count: usize,
        make: &(dyn Fn(usize) -> Result<T, Stop> + Sync),
        done: &TaskDone<'_>,
    ) -> Result<Vec<T>, Stop> {
        let Some(spread) = self.elsewhere.filter(|_| count > 0) else {
            let made = |number| make(number).inspect(|_| done(number));
            return (0..count).into_par_iter().map(made).collect();
        };
        let written = |number| {
            serde_json::to_value(make(number)?)
                .map_err(|error| Stop::new(format!("task {number} cannot be written: {error}")))
        };
        let read = |(number, value)| {
            serde_json::from_value(value)
                .map_err(|error| Stop::new(format!("task {number} cannot be read: {error}")))
        };
        let values = spread.compute(count, &written, done)?;
        values.into_iter().enumerate().map(read).collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    /// Computes tasks in reversed order, through text.
    struct Reversed;

    impl Spread for Reversed {
        fn compute(
            &self,
            count: usize,
            make: &MakeTask<'_>,
            done: &TaskDone<'_>,
        ) -> Result<Vec<Value>, Stop> {
            let mut values = Vec::new();
            for number in (0..count).rev() {
                let text = make(number)?.to_string();
                values.push(serde_json::from_str(&text).unwrap());
                done(number);
            }
            values.reverse();
            Ok(values)
        }
    }

    #[test]
    fn values_keep_order_and_bits_wherever_they_are_made() {
        let make = |number: usize| Ok((number, (number as f64 + 0.1).sqrt().sin() * 1e-300));
        let mut found: Vec<Vec<(usize, f64)>> = Vec::new();
        for tasks in [Tasks::here(), Tasks::elsewhere(&Reversed)] {
            let heard = AtomicUsize::new(0);
            let done = |_| {
                heard.fetch_add(1, Ordering::Relaxed);
            };
            found.push(tasks.map(40, &make, &done).unwrap());
            assert_eq!(heard.into_inner(), 40);
        }
        assert_eq!(found[0], found[1]);
        assert_eq!(found[0][7], (7, (7.0_f64 + 0.1).sqrt().sin() * 1e-300));
    }

    #[test]
    fn an_error_of_a_task_is_that_of_the_whole() {
        let make = |number: usize| match number {
            3 => Err(Stop::new("three has no value")),
            other => Ok(other),
        };
        for tasks in [Tasks::here(), Tasks::elsewhere(&Reversed)] {
            let stop = tasks.map(5, &make, &|_| ()).unwrap_err();
            assert_eq!(stop.message, "three has no value");
        }
    }
}
