#![allow(clippy::unwrap_used)]
//! Campaigns with a scheduler whose answers are defined here; real schedulers are used in the tests of the workspace.

use std::cell::{Cell, RefCell};
use std::path::PathBuf;
use std::sync::Mutex;

use lacuna::data::{Layout, Scenario};
use lacuna::plugin::executor::{Job, Recipe};
use lacuna_contract::{LINE, Line};
use lacuna_run::work::evaluate;

use super::*;
use crate::executors::cluster::scheduler::Rules;
use crate::executors::cluster::{Cause, Frame, Growth, Plan, Retry, States, TaskState, Worker};

type Answer<T> = Box<dyn Fn() -> Result<T, Stop>>;

/// A scheduler whose jobs end as soon as they are submitted.
struct Stub {
    /// Answer to a submission.
    submits: Answer<String>,
    /// True if jobs make their runs.
    works: bool,
    /// Answer to a query for a name.
    finds: Answer<Option<String>>,
    /// State of every task.
    state: Option<TaskState>,
    submitted: Cell<usize>,
    asked: Cell<usize>,
    cancelled: RefCell<Vec<String>>,
    retry: Retry,
    grow: Growth,
}

impl Stub {
    fn new(works: bool) -> Self {
        Self {
            submits: Box::new(|| Ok("7".to_owned())),
            works,
            finds: Box::new(|| Ok(Some("7".to_owned()))),
            state: None,
            submitted: Cell::new(0),
            asked: Cell::new(0),
            cancelled: RefCell::default(),
            retry: Retry::default(),
            grow: Growth::default(),
        }
    }
}

impl Scheduler for Stub {
    fn name(&self) -> &'static str {
        "stub"
    }

    fn rules(&self) -> Rules<'_> {
        let [poll, patience] = [10, 50].map(Duration::from_millis);
        Rules { pack: 1, retry: &self.retry, grow: &self.grow, poll, patience }
    }

    fn worker(&self) -> Worker<'_> {
        Worker { modules: &[], setup: &[], program: None, parallel: 1 }
    }

    fn most_tasks(&self) -> Result<usize, Stop> {
        Ok(100)
    }

    fn frame(&self, _: &Plan<'_>) -> Frame {
        Frame { file: "job.sh", directives: Vec::new(), task: "TASK", log: true }
    }

    fn submit(&self, plan: &Plan<'_>, script: &Path) -> Result<String, Stop> {
        assert!(script.is_file());
        self.submitted.set(self.submitted.get() + 1);
        if self.works {
            make_all(plan.folder, &Line {});
        }
        (self.submits)()
    }

    fn find(&self, _: &str) -> Result<Option<String>, Stop> {
        self.asked.set(self.asked.get() + 1);
        (self.finds)()
    }

    fn states(&self, all: &[&Submission]) -> Result<States, Stop> {
        let tasks = all.iter().flat_map(|s| s.open().map(|(task, _)| (s.number, task)));
        let state = self.state.as_ref();
        Ok(tasks.filter_map(|key| Some((key, state?.clone()))).collect())
    }

    fn cancel(&self, jobs: &[&str]) -> Result<(), Stop> {
        self.cancelled.borrow_mut().extend(jobs.iter().map(|&job| job.to_owned()));
        Ok(())
    }
}

/// Makes the runs of an order in the same way as its jobs.
fn make_all(folder: &Path, model: &dyn lacuna::plugin::Model) {
    let order = Order::read(folder).unwrap();
    let runs = folder.join(&order.runs).canonicalize().unwrap();
    let batch = order.batch(model, &runs);
    for (job, asked) in order.jobs.iter().zip(order.fingerprints().unwrap()) {
        let ended = evaluate(&batch, &[job]).pop().unwrap();
        let marker = Marker::of(&runs, &asked, ended.outcome, ended.seconds, "here").unwrap();
        marker.write(&runs, &job.name).unwrap();
    }
}

/// Outcome of three runs, the first of which has this input.
struct Ran {
    outcome: Result<(), Stop>,
    /// True for each reported run that has a result.
    handed: BTreeMap<usize, bool>,
    told: Vec<String>,
}

fn ran_from(first: f64, stub: &Stub, folder: &Path) -> Ran {
    let layout = Layout::number("y");
    let recipe = Recipe { name: LINE.to_owned(), options: String::new(), libraries: Vec::new() };
    let job = |(i, a): (usize, f64)| Job { name: format!("run{i}"), inputs: vec![a, 0.5] };
    let jobs: Vec<Job> = [first, 1.0, 2.0].into_iter().enumerate().map(job).collect();
    let told = Mutex::new(Vec::new());
    let batch = Batch {
        model: &Line {},
        recipe: &recipe,
        names: &["a".to_owned(), "b".to_owned()],
        units: &[],
        jobs: &jobs,
        layout: &layout,
        scenario: &Scenario::default(),
        study: folder,
        directory: folder,
        warn: &|text| told.lock().unwrap().push(text.to_owned()),
    };
    let mut handed = BTreeMap::new();
    let mut finished = |end: Finished| {
        handed.insert(end.index, end.outcome.is_ok());
        Ok(())
    };
    let outcome = follow(stub, &batch, &mut finished);
    let told = told.lock().unwrap().clone();
    Ran { outcome, handed, told }
}

fn ran(stub: &Stub, folder: &Path) -> Ran {
    ran_from(0.5, stub, folder)
}

fn all_done() -> BTreeMap<usize, bool> {
    (0..3).map(|i| (i, true)).collect()
}

fn submission(folder: &Path, number: usize) -> PathBuf {
    folder.join(format!("campaign/{number}/submission.json"))
}

fn timed_out<T>() -> Result<T, Stop> {
    Err(Stop::new(
        "`sbatch --parsable x` failed (exit code 1): sbatch: error: Batch job submission failed: \
         Socket timed out on send/recv operation",
    ))
}

#[test]
fn jobs_whose_number_was_lost_are_found_and_not_submitted_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut stub = Stub::new(true);
    stub.submits = Box::new(timed_out);
    let ran = ran(&stub, folder.path());
    assert_eq!(ran.outcome, Ok(()));
    assert_eq!((ran.handed, stub.submitted.get()), (all_done(), 1));
    let text = std::fs::read_to_string(submission(folder.path(), 1)).unwrap();
    assert!(text.contains("\"job\": \"7\""), "{text}");
}

#[test]
fn a_scheduler_that_is_slower_than_its_command_is_given_time() {
    let folder = tempfile::tempdir().unwrap();
    let mut stub = Stub::new(true);
    stub.submits = Box::new(timed_out);
    let times = Cell::new(0);
    stub.finds = Box::new(move || {
        times.set(times.get() + 1);
        Ok((times.get() > 1).then(|| "7".to_owned()))
    });
    assert_eq!(ran(&stub, folder.path()).outcome, Ok(()));
    assert_eq!((stub.submitted.get(), stub.asked.get()), (1, 2));
}

#[test]
fn jobs_that_are_refused_are_forgotten() {
    let folder = tempfile::tempdir().unwrap();
    let mut stub = Stub::new(false);
    // Words of the command itself do not show that the answer was lost.
    let refusal = "`sbatch socket.sh` failed (exit code 1): invalid partition specified";
    stub.submits = Box::new(move || Err(Stop::new(refusal)));
    stub.finds = Box::new(|| Ok(None));
    let ran = ran(&stub, folder.path());
    assert_eq!(ran.outcome.unwrap_err().message, refusal);
    assert_eq!(stub.asked.get(), 1);
    assert!(!submission(folder.path(), 1).exists());
}

#[test]
fn while_a_scheduler_does_not_answer_its_jobs_are_remembered() {
    let folder = tempfile::tempdir().unwrap();
    let mut stub = Stub::new(true);
    (stub.submits, stub.finds) = (Box::new(timed_out), Box::new(timed_out));
    let first = ran(&stub, folder.path());
    let stop = first.outcome.unwrap_err();
    assert!(stop.message.contains("unknown whether the scheduler has the jobs"), "{stop}");
    assert!(submission(folder.path(), 1).exists());
    // The scheduler answers again.
    let again = Stub::new(true);
    let second = ran(&again, folder.path());
    assert_eq!((second.outcome, second.handed), (Ok(()), all_done()));
    assert_eq!(again.submitted.get(), 0);
}

#[test]
fn jobs_that_a_scheduler_never_heard_of_are_submitted_after_all() {
    let folder = tempfile::tempdir().unwrap();
    let mut stub = Stub::new(false);
    (stub.submits, stub.finds) = (Box::new(timed_out), Box::new(timed_out));
    assert!(ran(&stub, folder.path()).outcome.is_err());
    let mut again = Stub::new(true);
    again.finds = Box::new(|| Ok(None));
    let second = ran(&again, folder.path());
    assert_eq!((second.outcome, second.handed), (Ok(()), all_done()));
    assert_eq!(again.submitted.get(), 1);
}

#[test]
fn jobs_that_end_before_their_first_run_cost_no_run() {
    let folder = tempfile::tempdir().unwrap();
    let mut stub = Stub::new(false);
    stub.state = Some(TaskState::Failed(Cause::Failure, "FAILED NonZeroExitCode".to_owned()));
    let first = ran(&stub, folder.path());
    let stop = first.outcome.unwrap_err();
    assert!(stop.message.contains("it ended before it began a run"), "{stop}");
    assert!(stop.help.unwrap().contains("`program`"));
    assert_eq!((first.handed.len(), stub.submitted.get()), (0, 1));
    assert_eq!(stub.cancelled.take(), ["7"]);
    // After the correction the runs are submitted again.
    let again = Stub::new(true);
    let second = ran(&again, folder.path());
    assert_eq!((second.outcome, second.handed), (Ok(()), all_done()));
    assert_eq!(again.submitted.get(), 1);
}

#[test]
fn a_reason_to_wait_for_ever_is_told_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut stub = Stub::new(false);
    stub.state = Some(TaskState::Held("PENDING BadConstraints".to_owned()));
    // Another process makes the runs while they wait.
    let place = folder.path().to_owned();
    let maker = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_secs(2));
        make_all(&place.join("campaign/1"), &Line {});
    });
    let ran = ran(&stub, folder.path());
    maker.join().unwrap();
    assert_eq!((ran.outcome, ran.handed), (Ok(()), all_done()));
    assert_eq!(ran.told, ["3 jobs wait for a reason other than the queue: PENDING BadConstraints"]);
}

#[test]
fn a_word_that_all_is_in_vain_is_not_kept() {
    let folder = tempfile::tempdir().unwrap();
    // The input for which the model declares all runs hopeless.
    let hopeless = -4.0;
    let first = ran_from(hopeless, &Stub::new(true), folder.path());
    assert!(first.outcome.unwrap_err().message.contains("no answer anywhere"));
    // Another marker of the same kind, from a job that ended later.
    make_all(&folder.path().join("campaign/1"), &Line {});
    let again = Stub::new(true);
    let second = ran_from(hopeless, &again, folder.path());
    assert!(second.outcome.unwrap_err().message.contains("no answer anywhere"));
    assert_eq!(again.submitted.get(), 1, "the model was not asked again");
}

#[test]
fn jobs_that_look_for_their_run_directory_in_the_old_place_are_submitted_anew() {
    let folder = tempfile::tempdir().unwrap();
    let (old, new, copy) =
        (folder.path().join("old"), folder.path().join("new"), folder.path().join("copy"));
    std::fs::create_dir(&old).unwrap();
    let mut stub = Stub::new(false);
    (stub.submits, stub.finds) = (Box::new(timed_out), Box::new(timed_out));
    assert!(ran(&stub, &old).outcome.is_err());
    let copied = std::process::Command::new("cp").arg("-r").args([&old, &copy]).status().unwrap();
    assert!(copied.success());
    std::fs::rename(&old, &new).unwrap();
    let again = Stub::new(true);
    let moved = ran(&again, &new);
    assert_eq!((moved.outcome, moved.handed), (Ok(()), all_done()));
    assert!(moved.told[0].contains("was moved"), "{:?}", moved.told);
    assert_eq!((again.submitted.get(), again.cancelled.take()), (1, vec!["7".to_owned()]));
    // A copy does not touch the jobs of the original.
    std::fs::rename(&new, &old).unwrap();
    let of_copy = Stub::new(true);
    let copied = ran(&of_copy, &copy);
    assert_eq!((copied.outcome, copied.handed), (Ok(()), all_done()));
    assert!(copied.told[0].contains("is a copy"), "{:?}", copied.told);
    assert_eq!((of_copy.submitted.get(), of_copy.cancelled.take().len()), (1, 0));
}
