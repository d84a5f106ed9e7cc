//! `slurm`: job arrays on a cluster.

mod environment;
mod reasons;
mod state;

use std::path::{Path, PathBuf};

use lacuna::plugin::executor::{Batch, Finished, Seen};
use lacuna::plugin::{Component, Context, Executor};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use lacuna::text::values::{Count, Positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::amount::{Memory, Span, as_clock};
use super::cluster::scheduler::Rules;
use super::cluster::script::{quoted, word};
use super::cluster::{self, Frame, Growth, Plan, Retry, Scheduler, States, Submission, Worker};
use super::{command, program};
use lacuna_run::process;

/// Runs the model on a cluster with Slurm, as job arrays.
///
/// ```toml
/// [executor]
/// use = "slurm"
/// partition = "batch"
/// account = "abc123"
/// time = "26 h"
/// nodes = 1
/// tasks = 96
/// modules = ["sierra/5.8"]
/// at_most = 40
/// ```
///
/// `lacuna run STUDY` submits all runs as arrays (as many as the maximum array size of the cluster requires), waits,
/// and reads the results as they arrive. It may be stopped at any time: the jobs continue, and `lacuna resume RUN`
/// finds them again, even days later; nothing is submitted twice. The job scripts are in the run directory,
/// `2-simulate/campaign/NUMBER/job.sh`.
///
/// A job makes `pack` runs, one after the other or `parallel` at a time, with the same program that submitted it.
/// Every run leaves a marker with its outcome. The marker decides; the scheduler is only asked why there is none.
/// Time in the queue never counts as a time-out. The run of a job that ended without a marker is submitted again as
/// `retry` says for the cause; runs of a pack that had not begun are always submitted again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Slurm {
    /// Partition (`--partition`).
    pub partition: Option<String>,
    /// Account to be charged (`--account`).
    pub account: Option<String>,
    /// Quality of service (`--qos`).
    pub qos: Option<String>,
    /// Features that the nodes must have (`--constraint`).
    pub constraint: Option<String>,
    /// Time limit of a job (`--time`), such as `26 h` or `1-02:00:00`; it applies to the whole pack.
    pub time: Option<Span>,
    /// Number of nodes of a job (`--nodes`).
    pub nodes: Option<Count>,
    /// Number of processes of a job (`--ntasks`), for a model that starts its own with `srun` or `mpirun`.
    pub tasks: Option<Count>,
    /// Number of cores of each process (`--cpus-per-task`).
    pub cpus: Option<Count>,
    /// Memory of a job on each node (`--mem`), such as `180 GB`.
    pub memory: Option<Memory>,
    /// Further options of `sbatch`, one per element, such as `--exclusive`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub extra: Vec<String>,
    /// Environment modules that each job loads.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub modules: Vec<String>,
    /// Shell lines that each job executes before its first run, after the modules. Each must be a complete command; a
    /// failing line ends the job, unless `|| true` is appended.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub setup: Vec<String>,
    /// Number of runs per job. Packing amortises queueing and start-up over short runs.
    pub pack: Count,
    /// Number of runs of a job made at a time.
    pub parallel: Count,
    /// Maximum number of jobs of one array that run at a time. Default: no limit.
    pub at_most: Option<Count>,
    /// Maximum number of jobs of one array, for users whose number of jobs is limited. Default: that of the cluster.
    /// The remaining runs form further arrays, which are submitted as soon as the cluster accepts them.
    pub array: Option<Count>,
    /// Number of resubmissions of a run, by cause.
    pub retry: Retry,
    /// Increase of the limits at resubmission.
    pub grow: Growth,
    /// Longest interval between two queries to the scheduler, in seconds; the first intervals are shorter.
    pub poll: Positive,
    /// Time by which files and accounting may lag behind the end of a job, in seconds.
    pub patience: Positive,
    /// Path of `lacuna` on the nodes; an absolute path need not exist on this machine. Default: the running program.
    pub program: Option<PathBuf>,
}

impl Default for Slurm {
    fn default() -> Self {
        Self {
            partition: None,
            account: None,
            qos: None,
            constraint: None,
            time: None,
            nodes: None,
            tasks: None,
            cpus: None,
            memory: None,
            extra: Vec::new(),
            modules: Vec::new(),
            setup: Vec::new(),
            pack: cluster::count(1),
            parallel: cluster::count(1),
            at_most: None,
            array: None,
            retry: Retry::default(),
            grow: Growth::default(),
            poll: cluster::positive(60.0),
            patience: cluster::positive(30.0),
            program: None,
        }
    }
}

impl Component for Slurm {
    fn check(&self, _: &Context<'_>, complaints: &mut Complaints<'_>) {
        let one_line = |text: &String| text.contains('\n');
        for (key, lines) in [("extra", &self.extra), ("modules", &self.modules)] {
            if lines.iter().any(one_line) {
                complaints.at(key).say(format!("an element of `{key}` has more than one line"));
            }
        }
        self.check_extra(complaints);
        if self.grow.time.get() != 1.0 && self.time.is_none() {
            complaints.at("grow.time").say("`grow.time` has no effect without `time`");
        }
        if self.grow.memory.get() != 1.0 && self.memory.is_none() {
            complaints.at("grow.memory").say("`grow.memory` has no effect without `memory`");
        }
    }

    fn environment(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let program = program::on_nodes(self.program.as_deref(), context.directory);
        program::check(program, complaints);
        for command in ["sbatch", "squeue", "scancel"] {
            if process::find(command, Path::new("."), None).is_none() {
                complaints.at("use").say(format!("there is no command `{command}` here")).help(
                    "run the study where jobs are submitted, or with `--set executor.use=local`",
                );
                return;
            }
        }
    }
}

impl Executor for Slurm {
    fn submit(
        &self,
        batch: &Batch<'_>,
        finished: &mut dyn FnMut(Finished) -> Result<(), Stop>,
    ) -> Result<(), Stop> {
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

impl Scheduler for Slurm {
    fn name(&self) -> &'static str {
        "slurm"
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
        let text = command::said("scontrol", &["show", "config"])?;
        let most = state::max_array_size(&text).unwrap_or(1001);
        Ok(self.array.map_or(most, |own| own.get().min(most)))
    }

    fn worker(&self) -> Worker<'_> {
        Worker {
            modules: &self.modules,
            setup: &self.setup,
            program: self.program.as_deref(),
            parallel: self.parallel.get(),
        }
    }

    fn frame(&self, plan: &Plan<'_>) -> Frame {
        Frame {
            file: "job.sh",
            directives: self.directives(plan),
            task: "SLURM_ARRAY_TASK_ID",
            log: false,
        }
    }

    fn submit(&self, _plan: &Plan<'_>, script: &Path) -> Result<String, Stop> {
        let script = script.display().to_string();
        let inside = std::env::var_os("SLURM_JOB_ID").is_some();
        let hidden = |name: &str| environment::is_hidden(name, self, inside);
        let said = command::said_without("sbatch", &["--parsable", &script], hidden)?;
        state::submitted(&said).ok_or_else(|| {
            Stop::new(format!("`sbatch` answered `{}` in place of a number", said.trim()))
        })
    }

    fn find(&self, name: &str) -> Result<Option<String>, Stop> {
        let queue = command::said("squeue", &["-h", "-t", "all", "--name", name, "-o", "%F"])?;
        if let Some(job) = queue.split_whitespace().next() {
            return Ok(Some(job.to_owned()));
        }
        // Without accounting there is no other source.
        let of_accounts = command::said(
            "sacct",
            &["-X", "-n", "-P", "--name", name, "-S", "now-100days", "-o", "JobID"],
        );
        let job = of_accounts.ok().and_then(|text| {
            let first = text.split_whitespace().next()?;
            Some(first.split('_').next().unwrap_or(first).to_owned())
        });
        Ok(job)
    }

    fn states(&self, submissions: &[&Submission]) -> Result<States, Stop> {
        state::states(submissions)
    }

    fn cancel(&self, jobs: &[&str]) -> Result<(), Stop> {
        // `--quiet`, because a job may have ended in the meantime.
        let words: Vec<&str> = std::iter::once("--quiet").chain(jobs.iter().copied()).collect();
        command::said("scancel", &words).map(drop)
    }
}

/// Options of `sbatch` that would prevent jobs from being found again, with their short forms.
const OWN: [(&str, &str); 9] = [
    ("--array", "-a"),
    ("--job-name", "-J"),
    ("--output", "-o"),
    ("--clusters", "-M"),
    ("--wait", "-W"),
    ("--chdir", "-D"),
    ("--requeue", ""),
    ("--parsable", ""),
    ("--test-only", ""),
];

/// Returns the option among [`OWN`] that a line of `extra` sets.
fn own_option(line: &str) -> Option<&'static str> {
    let is = |(long, short): &&(&str, &str)| {
        line.split(['=', ' ']).next() == Some(long)
            || short.len() == 2 && line.starts_with(short) && !line.starts_with("--")
    };
    OWN.iter().find(is).map(|(long, _)| *long)
}

impl Slurm {
    fn check_extra(&self, complaints: &mut Complaints<'_>) {
        if let Some(line) = self.extra.iter().find(|line| !line.starts_with('-')) {
            complaints
                .at("extra")
                .say("this is not an option of `sbatch`")
                .expected("an option such as `--exclusive`")
                .found(format!("`{line}`"));
        }
        if let Some(option) = self.extra.iter().find_map(|line| own_option(line)) {
            complaints
                .at("extra")
                .say(format!("with `{option}` Lacuna could not find the jobs of a study again"))
                .help(
                    "leave it out; to use another cluster, set the environment variable `SLURM_CLUSTERS`, which all commands of Slurm read",
                );
        }
    }

    /// Returns the directives that `sbatch` reads.
    fn directives(&self, plan: &Plan<'_>) -> Vec<String> {
        let throttle = self.at_most.map_or(String::new(), |most| format!("%{most}"));
        let log = plan.folder.join("task").display().to_string().replace('%', "%%");
        let mut lines = vec![
            format!("--job-name={}", plan.name),
            format!("--array=0-{}{throttle}", plan.tasks.saturating_sub(1)),
            format!("--output={}", word(&format!("{log}%a.txt"))),
            format!("--chdir={}", quoted(plan.study)),
            // Resubmission is decided by the study.
            "--no-requeue".to_owned(),
        ];
        let mut add = |option: &str, value: Option<String>| {
            lines.extend(value.map(|value| format!("--{option}={value}")));
        };
        add("partition", self.partition.clone());
        add("account", self.account.clone());
        add("qos", self.qos.clone());
        add("constraint", self.constraint.as_ref().map(|c| word(c)));
        add("time", self.time.as_ref().map(|time| as_clock(time.seconds() * plan.time)));
        add("nodes", self.nodes.map(|n| n.to_string()));
        add("ntasks", self.tasks.map(|n| n.to_string()));
        add("cpus-per-task", self.cpus.map(|n| n.to_string()));
        let kilobytes = |m: &Memory| (m.bytes() as f64 * plan.memory / 1024.0).ceil() as u64;
        add("mem", self.memory.as_ref().map(|m| format!("{}K", kilobytes(m))));
        lines.extend(self.extra.iter().cloned());
        lines.into_iter().map(|line| format!("#SBATCH {line}")).collect()
    }
}

lacuna::register!(Executor, "slurm", Slurm, aliases: ["sbatch"]);

#[cfg(test)]
mod tests;
