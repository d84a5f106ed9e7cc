//! `skeleton`: one run after the other.

use lacuna::plugin::executor::{Batch, Finished, Job};
use lacuna::plugin::model::EvalError;
use lacuna::plugin::{Component, Context, Executor};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_run::work::{Ended, evaluate};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Runs the model on this machine, one run after the other.
///
/// For models that use all cores themselves, or whose licence allows one run at a time; `local` makes several runs in
/// parallel. A run that the model rejects can be repeated, if it fails by chance or because of a network.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Skeleton {
    /// Largest number of attempts per run.
    pub attempts: usize,
}

impl Default for Skeleton {
    fn default() -> Self {
        Self { attempts: 1 }
    }
}

impl Component for Skeleton {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if self.attempts == 0 {
            complaints.at("attempts").say("no run is made").expected("at least 1").found(0);
        }
    }
}

impl Executor for Skeleton {
    fn submit(
        &self,
        batch: &Batch<'_>,
        finished: &mut dyn FnMut(Finished) -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        for (index, job) in batch.jobs.iter().enumerate() {
            let mut last = run(batch, job)?;
            for _ in 1..self.attempts {
                if matches!(last.outcome, Err(EvalError::Rejected(_))) {
                    last = run(batch, job)?;
                }
            }
            let Ended { outcome, seconds } = last;
            let outcome = match outcome {
                Ok(written) => Ok(written),
                Err(EvalError::Rejected(reason)) => Err(reason),
                Err(EvalError::Fatal(reason)) => return Err(Stop::new(reason)),
            };
            finished(Finished { index, outcome, seconds })?;
        }
        Ok(())
    }
}

/// Runs a job in this process and writes its response to a file; a panic of the model fails only that run.
fn run(batch: &Batch<'_>, job: &Job) -> Result<Ended, Stop> {
    let ended = evaluate(batch, &[job]).pop();
    ended.ok_or_else(|| Stop::new(format!("the run `{}` has no end", job.name)))
}

lacuna::register!(Executor, "skeleton", Skeleton);

#[cfg(test)]
mod tests {
    use std::path::PathBuf;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;
    use lacuna::data::{Layout, Scenario};
    use lacuna::plugin::Model;
    use lacuna::plugin::executor::Recipe;
    use lacuna::plugin::model::{Call, Response, Signature};

    /// A folder for one test.
    fn folder(name: &str) -> PathBuf {
        let folder =
            std::env::temp_dir().join(format!("skeleton-executor-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn it_keeps_the_contract() {
        let folder = folder("contract");
        let judged = lacuna_contract::executor("skeleton", &Skeleton::default(), &folder);
        assert_eq!(judged, Ok(()));
        std::fs::remove_dir_all(folder).unwrap();
    }

    /// A model that succeeds at every third call.
    #[derive(Default)]
    struct Moody(AtomicUsize);

    impl Component for Moody {}

    impl Model for Moody {
        fn signature(&self, _context: &Context<'_>) -> Signature {
            Signature { inputs: Vec::new(), layout: Layout::number("y"), resamples: false }
        }

        fn predict(&self, _call: &Call<'_>) -> Result<Response, EvalError> {
            let calls = self.0.fetch_add(1, Ordering::Relaxed) + 1;
            if !calls.is_multiple_of(3) {
                return Err(EvalError::Rejected("not now".to_owned()));
            }
            Ok(Response { values: vec![calls as f64], valid: true, facts: Vec::new() })
        }
    }

    #[test]
    fn runs_are_tried_as_often_as_it_says_and_end_in_order() {
        let folder = folder("attempts");
        let (layout, scenario) = (Layout::number("y"), Scenario::default());
        let jobs = ["a", "b"].map(|name| Job { name: name.to_owned(), inputs: Vec::new() });
        let recipe =
            Recipe { name: "moody".to_owned(), options: String::new(), libraries: Vec::new() };
        let ends = |attempts: usize| {
            let batch = Batch {
                model: &Moody::default(),
                recipe: &recipe,
                names: &[],
                units: &[],
                jobs: &jobs,
                layout: &layout,
                scenario: &scenario,
                study: &folder,
                directory: &folder,
                warn: &|_| {},
            };
            let mut ends = Vec::new();
            let mut finished = |end: Finished| {
                ends.push((end.index, end.outcome.map(|written| written.valid)));
                Ok(())
            };
            Skeleton { attempts }.submit(&batch, &mut finished).unwrap();
            ends
        };
        let failed = || Err("not now".to_owned());
        assert_eq!(ends(2), [(0, failed()), (1, Ok(true))]);
        assert_eq!(ends(3), [(0, Ok(true)), (1, Ok(true))]);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
