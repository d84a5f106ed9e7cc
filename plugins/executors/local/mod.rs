//! `local`: this machine.

mod processes;
mod threads;

use std::num::NonZeroUsize;
use std::path::PathBuf;

use lacuna::plugin::executor::{Batch, Finished};
use lacuna::plugin::{Component, Context, Executor};
use lacuna::run::Stop;
use lacuna::study::problem::Complaints;
use lacuna::work::Limits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::amount::Memory;
use super::program;

/// Runs the model on this machine, one run a thread or one run a process.
///
/// Each run's result file is written as the run finishes, so a killed study loses at most the
/// runs under way. The number of threads or processes changes the time and nothing else.
///
/// With `processes` every run is made in a process of its own kind (`lacuna work ORDER`): one that crashes or takes more
/// memory than it may costs its own run and no other, and processes can be pinned to processors.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Local {
    /// Number of runs at a time; when left out, that of the command line's `--threads`, or all cores.
    pub threads: Option<NonZeroUsize>,
    /// Number of processes, each of which makes one run at a time, in place of threads.
    pub processes: Option<NonZeroUsize>,
    /// Whether each process keeps to its own share of the processors (on Linux).
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub pin: bool,
    /// The memory that each process may allocate, such as `2 GB`, what it starts counted alone (on Linux).
    pub memory: Option<Memory>,
    /// The program that makes the runs of `processes`; the running one when left out.
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
                .say(format!(
                    "`{key}` says something of processes, and the runs are made by threads"
                ))
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
                complaints.at(key).say(format!("`{key}` is not known on this system"));
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
