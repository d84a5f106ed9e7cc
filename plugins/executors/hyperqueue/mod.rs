//! `hyperqueue`: task arrays through the `hq` of the user's installation.

mod allocation;
mod state;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lacuna::plugin::executor::{Batch, Finished, Seen};
use lacuna::plugin::{Component, Context, Executor};
use lacuna::run::Stop;
use lacuna::study::problem::Complaints;
use lacuna::study::values::{Count, Positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::amount::Span;
use super::cluster::scheduler::Rules;
use super::cluster::{self, Frame, Growth, Plan, Retry, Scheduler, States, Submission, Worker};
use super::command::said;
use super::program;
use crate::models::process;
pub use allocation::{Allocation, Manager};

/// Runs the model on the workers of a HyperQueue server, as task arrays.
///
/// ```toml
/// [executor]
/// use = "hyperqueue"
/// cpus = 8
/// time = "2 h"
/// allocation = { manager = "slurm", time = "12 h", arguments = ["--partition=batch", "--account=abc123"] }
/// ```
///
/// Good for many runs that are short or need a part of a node only: HyperQueue takes whole nodes from Slurm or PBS and deals
/// the runs out to them itself. The server must run (`hq server start`, best with a journal, so that it survives a
/// restart); workers are those that you start, or those of `allocation`. Needs `hq` 0.18 or later.
///
/// Submitting, waiting, stopping and going on is as with `slurm`: state is in the run directory and in the server, and the
/// marker that each run leaves is what counts. The exit code of `hq job wait` is not asked: it says nothing of
/// failed tasks.
///
/// Reference: Beránek et al., `SoftwareX` 27 (2024) 101814.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HyperQueue {
    /// The `hq` command: a name in `PATH`, or a path from the study's folder.
    pub command: String,
    /// The server's folder (`--server-dir`); that of `HQ_SERVER_DIR` or of the home folder when left out.
    pub server: Option<PathBuf>,
    /// Cores of each task.
    pub cpus: Option<Count>,
    /// Whole nodes of each task, for a model that starts its own processes on several.
    pub nodes: Option<Count>,
    /// Other resources of each task by name, such as `{ "gpus/nvidia" = "1", mem = "16000" }`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub resources: BTreeMap<String, String>,
    /// The time limit of a task, such as `2 h`: that of a whole pack.
    pub time: Option<Span>,
    /// The time that a worker must have left to be given a task; that of `time` when left out.
    pub time_request: Option<Span>,
    /// Tasks of a greater priority go first.
    pub priority: i32,
    /// Further options of `hq submit`, such as `--pin=taskset`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub extra: Vec<String>,
    /// Environment modules that each task loads.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub modules: Vec<String>,
    /// Lines of shell that each task runs before its first run, after the modules. Each is a whole command; one that fails ends
    /// the task, and with `|| true` behind it may fail.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub setup: Vec<String>,
    /// Runs of a task.
    pub pack: Count,
    /// How many runs of a task are made at a time.
    pub parallel: Count,
    /// How often a run is submitted again, by cause. A worker that is lost is a failure of the node; the server itself tries
    /// such tasks again a few times (`--crash-limit`).
    pub retry: Retry,
    /// What it then gets more of; of memory there is nothing to give.
    pub grow: Growth,
    /// The longest pause between two questions to the server, in seconds. The first pauses are shorter.
    pub poll: Positive,
    /// How long files may lag behind the end of a task, in seconds.
    pub patience: Positive,
    /// `lacuna` as the nodes find it: a path from the root is theirs alone; the running program when left out.
    pub program: Option<PathBuf>,
    /// Nodes that the server takes from a cluster by itself; none when left out.
    pub allocation: Option<Allocation>,
}

impl Default for HyperQueue {
    fn default() -> Self {
        Self {
            command: "hq".to_owned(),
            server: None,
            cpus: None,
            nodes: None,
            resources: BTreeMap::new(),
            time: None,
            time_request: None,
            priority: 0,
            extra: Vec::new(),
            modules: Vec::new(),
            setup: Vec::new(),
            pack: cluster::count(1),
            parallel: cluster::count(1),
            retry: Retry::default(),
            grow: Growth::default(),
            poll: cluster::positive(30.0),
            patience: cluster::positive(30.0),
            program: None,
            allocation: None,
        }
    }
}

impl Component for HyperQueue {
    fn check(&self, _: &Context<'_>, complaints: &mut Complaints<'_>) {
        if self.cpus.is_some() && self.nodes.is_some() {
            complaints
                .at("nodes")
                .say("a task has whole nodes or some cores")
                .expected("`nodes` or `cpus`")
                .found("both");
        }
        if self.grow.time.get() != 1.0 && self.time.is_none() {
            complaints.at("grow.time").say("there is no `time` that could grow");
        }
    }

    fn environment(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let program = program::on_nodes(self.program.as_deref(), context.directory);
        program::check(program, complaints);
        if process::find(&self.command, context.directory, None).is_none() {
            complaints
                .at("command")
                .say(format!("there is no command `{}` here", self.command))
                .help("install HyperQueue, or run with `--set executor.use=local`");
        }
    }
}

impl Executor for HyperQueue {
    fn submit(
        &self,
        batch: &Batch<'_>,
        finished: &mut dyn FnMut(Finished) -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        if let Some(allocation) = self.allocation.as_ref().filter(|_| !batch.jobs.is_empty()) {
            allocation.ensure(|words| self.ask(words))?;
        }
        cluster::follow(self, batch, finished)
    }

    fn waits(&self) -> bool {
        true
    }

    fn look(&self, directory: &Path) -> Result<Vec<Seen>, Stop> {
        cluster::look(self, directory)
    }

    fn cancel(&self, directory: &Path) -> Result<usize, Stop> {
        cluster::cancel(self, directory)
    }
}

impl Scheduler for HyperQueue {
    fn name(&self) -> &'static str {
        "hyperqueue"
    }

    fn rules(&self) -> Rules<'_> {
        Rules {
            pack: self.pack.get(),
            retry: &self.retry,
            grow: &self.grow,
            poll: self.poll.get(),
            patience: self.patience.get(),
        }
    }

    fn most_tasks(&self) -> Result<usize, Stop> {
        // The server has no limit of its own; a file of job information should stay readable.
        Ok(100_000)
    }

    fn worker(&self) -> Worker<'_> {
        Worker {
            modules: &self.modules,
            setup: &self.setup,
            program: self.program.as_deref(),
            parallel: self.parallel.get(),
        }
    }

    fn frame(&self, _plan: &Plan<'_>) -> Frame {
        Frame { file: "task.sh", directives: Vec::new(), task: "HQ_TASK_ID", log: true }
    }

    fn submit(&self, plan: &Plan<'_>, script: &Path) -> Result<String, Stop> {
        let said = self.ask(&self.words(plan, script))?;
        state::submitted(&said).ok_or_else(|| {
            Stop::new(format!("`hq submit` answered `{}` in place of a number", said.trim()))
        })
    }

    fn find(&self, name: &str) -> Result<Option<String>, Stop> {
        let words = ["job", "list", "--all"].map(str::to_owned);
        state::find(&self.ask(&words)?, name)
    }

    fn states(&self, submissions: &[&Submission]) -> Result<States, Stop> {
        let mut states = States::new();
        for submission in submissions {
            let Some(job) = &submission.job else { continue };
            let words = ["job", "info", job].map(str::to_owned);
            state::read(&self.ask(&words)?, submission, &mut states)?;
        }
        Ok(states)
    }

    fn cancel(&self, jobs: &[&str]) -> Result<(), Stop> {
        self.ask(&["job".to_owned(), "cancel".to_owned(), jobs.join(",")]).map(drop)
    }
}

impl HyperQueue {
    /// What `hq` answers, as JSON text.
    fn ask(&self, words: &[String]) -> Result<String, Stop> {
        let mut all: Vec<String> = vec!["--output-mode=json".to_owned()];
        all.extend(self.server.as_ref().map(|folder| format!("--server-dir={}", folder.display())));
        all.extend(words.iter().cloned());
        let all: Vec<&str> = all.iter().map(String::as_str).collect();
        said(&self.command, &all)
            .map_err(|stop| stop.help("is the server running? `hq server info` tells"))
    }

    /// The words after `hq`.
    fn words(&self, plan: &Plan<'_>, script: &Path) -> Vec<String> {
        let mut words = vec!["submit".to_owned()];
        let mut add = |option: &str, value: String| words.push(format!("--{option}={value}"));
        add("name", plan.name.to_owned());
        add("array", format!("0-{}", plan.tasks.saturating_sub(1)));
        add("cwd", plan.study.display().to_string());
        // The script keeps what is printed.
        add("stdout", "none".to_owned());
        add("stderr", "none".to_owned());
        if let Some(cpus) = self.cpus {
            add("cpus", cpus.to_string());
        }
        if let Some(nodes) = self.nodes {
            add("nodes", nodes.to_string());
        }
        for (name, amount) in &self.resources {
            add("resource", format!("{name}={amount}"));
        }
        let seconds = |span: &Span| format!("{}s", (span.seconds() * plan.time).ceil());
        if let Some(time) = &self.time {
            add("time-limit", seconds(time));
        }
        if let Some(time) = self.time_request.as_ref().or(self.time.as_ref()) {
            add("time-request", seconds(time));
        }
        if self.priority != 0 {
            add("priority", self.priority.to_string());
        }
        words.extend(self.extra.iter().cloned());
        words.extend(["--", "bash", &script.display().to_string()].map(str::to_owned));
        words
    }
}

lacuna::register!(Executor, "hyperqueue", HyperQueue, aliases: ["hq"]);

#[cfg(test)]
mod tests;
