//! `local`: runs on this machine.

mod processes;
mod threads;

use std::num::NonZeroUsize;
use std::path::PathBuf;

use lacuna::plugin::executor::{Batch, Finished};
use lacuna::plugin::{Component, Context, Executor};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use lacuna_run::work::Limits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::amount::Memory;
use super::program;

/// Runs the model on this machine, one run per thread or one run per process.
///
/// The result file of each run is written as the run finishes, so that a killed study loses at most the runs in
/// progress. The number of threads or processes changes only the time, not the results.
///
/// With `processes` the runs are made in separate processes (`lacuna work ORDER`): one that crashes or exceeds its
/// memory costs only its own run, and processes can be pinned to processors.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Local {
    /// Number of runs at a time. Default: that of the command line's `--threads`, or all cores.
    pub threads: Option<NonZeroUsize>,
    /// Number of processes that make one run each at a time, in place of threads.
    pub processes: Option<NonZeroUsize>,
    /// If true, each process is restricted to its own share of the processors (Linux only).
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub pin: bool,
    /// Maximum memory that each process may allocate, such as `2 GB`; processes that it starts have this limit each
    /// (Linux only). A run that exceeds it fails.
    pub memory: Option<Memory>,
    /// Program that makes the runs of `processes`. Default: the running program.
    pub program: Option<PathBuf>,
}

impl Component for Local {
    fn check(&self, _: &Context<'_>, complaints: &mut Complaints<'_>) {
        if self.processes.is_some() {
            if self.threads.is_some() {
                complaints
                    .at("threads")
                    .say("runs are made by threads or by processes")
                    .expected("`threads` or `processes`")
                    .found("both");
            }
            return;
        }
        let of_processes = [
            ("pin", self.pin),
            ("memory", self.memory.is_some()),
            ("program", self.program.is_some()),
        ];
        for (key, _) in of_processes.iter().filter(|(_, given)| *given) {
            complaints
                .at(key)
                .say(format!("`{key}` applies to processes, but the runs are made by threads"))
                .help("add `processes = N`");
        }
    }

    fn environment(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if self.processes.is_none() {
            return;
        }
        program::check(program::program(self.program.as_deref(), context.directory), complaints);
        for (key, given) in [("pin", self.pin), ("memory", self.memory.is_some())] {
            if given && !Limits::are_known() {
                complaints.at(key).say(format!("`{key}` is not supported on this system"));
            }
        }
    }
}

impl Executor for Local {
    fn submit(
        &self,
        batch: &Batch<'_>,
        finished: &mut dyn FnMut(Finished) -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        match self.processes {
            Some(processes) => processes::submit(self, processes.get(), batch, finished),
            None => threads::submit(self.threads, batch, finished),
        }
    }
}

lacuna::register!(Executor, "local", Local, aliases: ["threads", "multiprocessing"]);
