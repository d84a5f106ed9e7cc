//! `hyperqueue`: task arrays through the user's own `hq`.

mod allocation;
mod state;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lacuna::plugin::executor::{Batch, Finished, Seen};
use lacuna::plugin::{Component, Context, Executor};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use lacuna::text::values::{Count, Positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::amount::Span;
use super::cluster::scheduler::Rules;
use super::cluster::{self, Frame, Growth, Plan, Retry, Scheduler, States, Submission, Worker};
use super::command::said;
use super::program;
use lacuna_run::process;

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
/// Suitable for many runs that are short or need only a part of a node: HyperQueue takes whole nodes from Slurm or
/// PBS and distributes the runs among them itself. The server must be running (`hq server start`, preferably with a
/// journal, so that it survives a restart); workers are those that you start, or those of `allocation`. Needs `hq`
/// 0.18 or later.
///
/// Submitting, waiting, stopping and resuming work as with `slurm`: the state is in the run directory and in the
/// server, and the marker that each run leaves decides. The exit code of `hq job wait` is not used, because it does
/// not tell about failed tasks.
///
/// Reference: Beránek et al., `SoftwareX` 27 (2024) 101814.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HyperQueue {
    /// `hq` command: a name in `PATH`, or a path from the study's folder.
    pub command: String,
    /// Folder of the server (`--server-dir`). Default: that of `HQ_SERVER_DIR` or of the home folder.
    pub server: Option<PathBuf>,
    /// Number of cores of each task. Default: that of the server.
    pub cpus: Option<Count>,
    /// Number of whole nodes of each task, for a model that starts its own processes on several nodes. Not together
    /// with `cpus`.
    pub nodes: Option<Count>,
    /// Other resources of each task by name, such as `{ "gpus/nvidia" = "1", mem = "16000" }`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub resources: BTreeMap<String, String>,
    /// Time limit of a task, such as `2 h`; it applies to the whole pack. Default: no limit.
    pub time: Option<Span>,
    /// Time that a worker must have left to be given a task. Default: the value of `time`.
    pub time_request: Option<Span>,
    /// Priority of the tasks; higher values go first.
    pub priority: i32,
    /// Further options of `hq submit`, such as `--pin=taskset`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub extra: Vec<String>,
    /// Environment modules that each task loads.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub modules: Vec<String>,
    /// Shell lines that each task executes before its first run, after the modules. Each must be a complete command;
    /// a failing line ends the task, unless `|| true` is appended.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub setup: Vec<String>,
    /// Number of runs per task. Packing amortises the start of a task over short runs.
    pub pack: Count,
    /// Number of runs of a task made at a time.
    pub parallel: Count,
    /// Number of resubmissions of a run, by cause. A lost worker counts as a node failure; the server itself repeats
    /// such tasks a few times (`--crash-limit`).
    pub retry: Retry,
    /// Increase of the limits at resubmission; only `time` has an effect here.
    pub grow: Growth,
    /// Longest interval between two queries to the server, in seconds; the first intervals are shorter.
    pub poll: Positive,
    /// Time by which files may lag behind the end of a task, in seconds.
    pub patience: Positive,
    /// Path of `lacuna` on the nodes; an absolute path need not exist on this machine. Default: the running program.
    pub program: Option<PathBuf>,
    /// Allocations that the server requests from a cluster by itself. Default: none.
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
                .say("a task uses either whole nodes or some cores")
                .expected("`nodes` or `cpus`")
                .found("both");
        }
        if self.grow.time.get() != 1.0 && self.time.is_none() {
            complaints.at("grow.time").say("`grow.time` has no effect without `time`");
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
            poll: self.poll.seconds(),
            patience: self.patience.seconds(),
        }
    }

    fn most_tasks(&self) -> Result<usize, Stop> {
        // The server has no limit of its own; this one keeps a listing of the job readable.
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
    /// Runs `hq` and returns its answer, a JSON text.
    fn ask(&self, words: &[String]) -> Result<String, Stop> {
        let mut all: Vec<String> = vec!["--output-mode=json".to_owned()];
        all.extend(self.server.as_ref().map(|folder| format!("--server-dir={}", folder.display())));
        all.extend(words.iter().cloned());
        let all: Vec<&str> = all.iter().map(String::as_str).collect();
        said(&self.command, &all)
            .map_err(|stop| stop.help("is the server running? `hq server info` tells"))
    }

    /// Returns the arguments of `hq submit`.
    fn words(&self, plan: &Plan<'_>, script: &Path) -> Vec<String> {
        let mut words = vec!["submit".to_owned()];
        let mut add = |option: &str, value: String| words.push(format!("--{option}={value}"));
        add("name", plan.name.to_owned());
        add("array", format!("0-{}", plan.tasks.saturating_sub(1)));
        add("cwd", plan.study.display().to_string());
        // The script itself redirects its output.
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
