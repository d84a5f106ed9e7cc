//! Nodes that the server takes from a cluster by itself.

use lacuna::run::{Stop, files};
use lacuna::study::values::Count;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::executors::amount::Span;

/// A queue of allocations: the server submits jobs to the cluster, each of which becomes a worker, as long as there are tasks.
///
/// The queue is made when the study first submits, under a name that is made of its options, and used again by whoever
/// has the same; `hq alloc list` shows it, `hq alloc remove` ends it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Allocation {
    /// The cluster's own scheduler.
    pub manager: Manager,
    /// The time limit of each allocation. It must be longer than that of a task.
    pub time: Span,
    /// How many allocations wait in the queue at a time; 1 when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub backlog: Option<Count>,
    /// Nodes of an allocation at most; 1 when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodes: Option<Count>,
    /// Workers at a time at most; no limit when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_most: Option<Count>,
    /// Cores of each worker; those of its node when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cpus: Option<Count>,
    /// How long a worker without tasks is kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub idle: Option<Span>,
    /// A line of shell that each node runs before its worker.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub setup: Option<String>,
    /// Options of `sbatch` or `qsub`: partition, account and the like; neither nodes nor time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub arguments: Vec<String>,
}

/// The scheduler of a cluster.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Manager {
    /// Slurm.
    Slurm,
    /// PBS, or one that has its `qsub`.
    Pbs,
}

impl Allocation {
    /// Makes the queue where the server has none of its name.
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

    /// The words after `hq`.
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
