//! Contract of executors.

use std::collections::BTreeMap;
use std::path::Path;

use lacuna::data::Scenario;
use lacuna::plugin::executor::{Batch, Executor, Finished, Job, Recipe};
use lacuna::plugin::model::{Call, EvalError, Input, Model, Response, Signature};
use lacuna::plugin::{Component, Context};
use lacuna::run::Stop;
use lacuna_run::arrays;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::judge::{Check, judge, layout, same_on_threads};

/// Tests an executor against its contract; result files go to folders in `scratch`.
///
/// - Every job is passed on once, with a file that contains the model's response bit for bit, on any number of threads.
/// - A run that the model rejects, that panics, or whose response is NaN is passed on as failed with a reason, and does
///   not affect other runs.
/// - If the model fails permanently the executor stops with the model's reason.
/// - If the receiver of results fails the executor stops with the receiver's reason.
/// - An empty batch is not an error.
///
/// The model is [`Line`]. An executor that starts other processes needs a program in which that is registered as
/// [`LINE`] and which calls [`lacuna_run::work::work`].
pub fn executor(name: &str, executor: &dyn Executor, scratch: &Path) -> Result<(), Vec<String>> {
    let checks: [Check<'_>; 5] = [
        ("hands over every job", Box::new(|| hands_over_every_job(executor, scratch))),
        ("bears failing runs", Box::new(|| bears_failing_runs(executor, scratch))),
        ("stops for good", Box::new(|| stops_for_good(executor, scratch))),
        ("stops when told", Box::new(|| stops_when_told(executor, scratch))),
        ("bears an empty batch", Box::new(|| bears_an_empty_batch(executor, scratch))),
    ];
    judge("executor", name, &checks)
}

/// Name under which [`Line`] is registered.
pub const LINE: &str = "contract_line";

/// A linear function of the position along the layout; its first input also selects how it fails.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Line {}

const REFUSED: f64 = -1.0;
const PANICS: f64 = -2.0;
const NOT_A_NUMBER: f64 = -3.0;
const HOPELESS: f64 = -4.0;

impl Component for Line {}

impl Model for Line {
    fn signature(&self, _context: &Context<'_>) -> Signature {
        let input = |name: &str| Input {
            name: name.to_owned(),
            unit: lacuna::data::Unit::dimensionless(),
            default: Some(1.0),
            range: (-10.0, 10.0),
            description: "a coefficient".to_owned(),
        };
        Signature { inputs: vec![input("a"), input("b")], layout: layout(), resamples: false }
    }

    fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError> {
        let (a, b) = (call.inputs[0], call.inputs[1]);
        if a == REFUSED {
            return Err(EvalError::Rejected("no answer here".to_owned()));
        }
        if a == HOPELESS {
            return Err(EvalError::Fatal("no answer anywhere".to_owned()));
        }
        assert!(a != PANICS, "a planted panic: the executor must bear it");
        let a = if a == NOT_A_NUMBER { f64::NAN } else { a };
        let values = (0..call.layout.len()).map(|i| a + b * (i as f64).sqrt()).collect();
        Ok(Response { values, valid: b < 3.0, facts: Vec::new() })
    }
}

fn names() -> Vec<String> {
    ["a", "b"].map(str::to_owned).to_vec()
}

fn jobs(first: &[f64]) -> Vec<Job> {
    let job = |(i, &a): (usize, &f64)| Job {
        name: format!("run{:03}", i + 1),
        inputs: vec![a, 0.1 + i as f64],
    };
    first.iter().enumerate().map(job).collect()
}

type Handed = BTreeMap<usize, Result<(Vec<f64>, bool), String>>;

/// Results passed on: the contents of the file and its validity, or the reason why there is none.
fn run(
    executor: &dyn Executor,
    jobs: &[Job],
    folder: &Path,
    mut most: usize,
) -> Result<(Handed, Result<(), Stop>), String> {
    std::fs::create_dir_all(folder).map_err(|error| error.to_string())?;
    let (layout, scenario) = (layout(), Scenario::default());
    let recipe = Recipe { name: LINE.to_owned(), options: String::new(), libraries: Vec::new() };
    let batch = Batch {
        model: &Line {},
        recipe: &recipe,
        names: &names(),
        units: &[],
        jobs,
        layout: &layout,
        scenario: &scenario,
        study: folder,
        directory: folder,
        warn: &|_| {},
    };
    let mut handed = Handed::new();
    let mut broken = None;
    let mut finished = |end: Finished| {
        if most == 0 {
            return Err(Stop::new("nobody takes the results"));
        }
        most -= 1;
        let outcome = end.outcome.and_then(|made| {
            let stored = arrays::read(&folder.join(made.file), &layout.name);
            let stored = stored.map_err(|stop| format!("no sound file: {stop}"))?.into_values();
            Ok((stored, made.valid))
        });
        if end.seconds.is_nan() || end.seconds < 0.0 {
            broken = Some(format!("job {} took {} s", end.index, end.seconds));
        }
        if handed.insert(end.index, outcome).is_some() {
            broken = Some(format!("job {} is handed over twice", end.index));
        }
        Ok(())
    };
    let result = executor.submit(&batch, &mut finished);
    broken.map_or(Ok((handed, result)), Err)
}

fn hands_over_every_job(executor: &dyn Executor, scratch: &Path) -> Result<(), String> {
    let folder = scratch.join("every");
    let jobs = jobs(&[0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5]);
    let all = || {
        let (handed, result) = run(executor, &jobs, &folder, usize::MAX)?;
        result.map_err(|stop| format!("it stops: {stop}"))?;
        Ok(handed)
    };
    let handed = all()?;
    let (layout, scenario) = (layout(), Scenario::default());
    for (i, job) in jobs.iter().enumerate() {
        let call = Call {
            inputs: &job.inputs,
            names: &names(),
            units: &[],
            layout: &layout,
            scenario: &scenario,
            study: scratch,
            directory: None,
        };
        let expected = Line {}.predict(&call).map_err(|error| error.to_string())?;
        match handed.get(&i) {
            Some(Ok((stored, valid))) => {
                if stored != &expected.values || *valid != expected.valid {
                    return Err(format!("job {i} has another response than the model gives"));
                }
            }
            Some(Err(reason)) => return Err(format!("job {i} failed: {reason}")),
            None => return Err(format!("job {i} is not handed over")),
        }
    }
    same_on_threads(all)
}

fn bears_failing_runs(executor: &dyn Executor, scratch: &Path) -> Result<(), String> {
    let jobs = jobs(&[1.0, REFUSED, 2.0, PANICS, 3.0, NOT_A_NUMBER, 4.0]);
    let (handed, result) = run(executor, &jobs, &scratch.join("failing"), usize::MAX)?;
    result.map_err(|stop| format!("it stops: {stop}"))?;
    for i in 0..jobs.len() {
        let outcome = handed.get(&i).ok_or_else(|| format!("job {i} is not handed over"))?;
        match (i % 2, outcome) {
            (0, Err(reason)) => return Err(format!("the sound job {i} failed: {reason}")),
            (1, Ok(_)) => return Err(format!("the failing job {i} is handed over as done")),
            (1, Err(reason)) if reason.trim().is_empty() => {
                return Err(format!("the failing job {i} has no reason"));
            }
            _ => {}
        }
    }
    match &handed[&1] {
        Err(reason) if reason.contains("no answer here") => Ok(()),
        _ => Err("the model's own reason is lost".into()),
    }
}

fn stops_for_good(executor: &dyn Executor, scratch: &Path) -> Result<(), String> {
    let (_, result) =
        run(executor, &jobs(&[1.0, HOPELESS, 2.0]), &scratch.join("hopeless"), usize::MAX)?;
    match result {
        Ok(()) => Err("it goes on when the model has given up".into()),
        Err(stop) if stop.message.contains("no answer anywhere") => Ok(()),
        Err(stop) => Err(format!("the model's reason is lost: {stop}")),
    }
}

fn stops_when_told(executor: &dyn Executor, scratch: &Path) -> Result<(), String> {
    let (handed, result) = run(executor, &jobs(&[1.0, 2.0, 3.0, 4.0]), &scratch.join("told"), 2)?;
    match result {
        Ok(()) => Err("it goes on when nobody takes the results".into()),
        Err(stop) if stop.message != "nobody takes the results" => {
            Err(format!("the reason is lost: {stop}"))
        }
        Err(_) if handed.len() != 2 => Err(format!("{} jobs and not 2", handed.len())),
        Err(_) => Ok(()),
    }
}

fn bears_an_empty_batch(executor: &dyn Executor, scratch: &Path) -> Result<(), String> {
    let (handed, result) = run(executor, &[], &scratch.join("empty"), usize::MAX)?;
    result.map_err(|stop| format!("it stops: {stop}"))?;
    if handed.is_empty() { Ok(()) } else { Err("jobs that nobody asked for".into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An executor that runs nothing.
    struct Idle;

    impl Component for Idle {}

    impl Executor for Idle {
        fn submit(
            &self,
            _: &Batch<'_>,
            _: &mut dyn FnMut(Finished) -> Result<(), Stop>,
        ) -> Result<(), Stop> {
            Ok(())
        }
    }

    #[test]
    fn an_idle_executor_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let breaches = executor("idle", &Idle, folder.path()).unwrap_err();
        assert_eq!(breaches.len(), 4, "{breaches:?}");
        assert!(breaches[0].ends_with("job 0 is not handed over"), "{breaches:?}");
    }
}
