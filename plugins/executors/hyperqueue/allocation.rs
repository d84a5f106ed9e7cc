//! Nodes that the server requests from a cluster by itself.

use lacuna::run::{Stop, files};
use lacuna::text::values::Count;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::executors::amount::Span;

/// A queue of allocations: as long as there are tasks, the server submits jobs to the cluster, each of which becomes
/// a worker.
///
/// The queue is created at the first submission of the study, under a name derived from its options, and is shared by
/// studies with the same options; `hq alloc list` shows it, `hq alloc remove` ends it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Allocation {
    /// Scheduler of the cluster.
    pub manager: Manager,
    /// Time limit of each allocation; must be longer than that of a task.
    pub time: Span,
    /// Number of allocations waiting in the queue at a time. Default: 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub backlog: Option<Count>,
    /// Maximum number of nodes of an allocation. Default: 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodes: Option<Count>,
    /// Maximum number of workers at a time. Default: no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_most: Option<Count>,
    /// Number of cores of each worker. Default: those of its node.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cpus: Option<Count>,
    /// Time for which a worker without tasks is kept. Default: that of the server.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub idle: Option<Span>,
    /// Shell line that each node executes before its worker starts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub setup: Option<String>,
    /// Options of `sbatch` or `qsub`, such as partition and account, but neither nodes nor time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub arguments: Vec<String>,
}

/// Scheduler of a cluster.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Manager {
    /// Slurm, with `sbatch`.
    Slurm,
    /// PBS, or another scheduler with the `qsub` of PBS.
    Pbs,
}

impl Allocation {
    /// Creates the queue if the server has none of its name.
    pub fn ensure(&self, ask: impl Fn(&[String]) -> Result<String, Stop>) -> Result<(), Stop> {
        let name = self.name();
        let queues = ask(&["alloc", "list"].map(str::to_owned))?;
        let queues: Value = serde_json::from_str(&queues)
            .map_err(|error| Stop::new(format!("`hq alloc list` gave no JSON: {error}")))?;
        let known = queues.as_array().into_iter().flatten();
        if known.into_iter().any(|queue| queue["name"] == name.as_str()) {
            return Ok(());
        }
        ask(&self.words(&name)).map(drop)
    }

    fn name(&self) -> String {
        format!("lacuna-{}", &files::hash(format!("{self:?}").as_bytes())[..10])
    }

    /// Returns the arguments of `hq`.
    pub fn words(&self, name: &str) -> Vec<String> {
        let manager = match self.manager {
            Manager::Slurm => "slurm",
            Manager::Pbs => "pbs",
        };
        let mut words = ["alloc", "add", manager].map(str::to_owned).to_vec();
        let mut add = |option: &str, value: Option<String>| {
            words.extend(value.map(|value| format!("--{option}={value}")));
        };
        let seconds = |span: &Span| format!("{}s", span.seconds().ceil());
        add("name", Some(name.to_owned()));
        add("time-limit", Some(seconds(&self.time)));
        add("backlog", self.backlog.map(|n| n.to_string()));
        add("max-workers-per-alloc", self.nodes.map(|n| n.to_string()));
        add("max-worker-count", self.at_most.map(|n| n.to_string()));
        add("cpus", self.cpus.map(|n| n.to_string()));
        add("idle-timeout", self.idle.as_ref().map(seconds));
        add("worker-start-cmd", self.setup.clone());
        if !self.arguments.is_empty() {
            words.push("--".to_owned());
            words.extend(self.arguments.iter().cloned());
        }
        words
    }
}
