//! Why a run that was handed to a scheduler has no result, and how often it is tried again.

use std::fmt;

use lacuna::study::values::Positive;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Why a job ended without a result of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The machine failed.
    NodeFailure,
    /// The scheduler needed the machine for something else.
    Preempted,
    /// The time limit.
    Timeout,
    /// The memory limit.
    OutOfMemory,
    /// Somebody cancelled it.
    Cancelled,
    /// It ended before it had begun a run.
    Start,
    /// It ended by itself: with an exit code, or by a signal.
    Failure,
    /// The scheduler does not know of it any more, and it left no word.
    Lost,
}

impl Cause {
    /// Whether all runs of a job share it, those that were not begun too.
    pub fn concerns_all(self) -> bool {
        self == Self::Cancelled
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NodeFailure => "the node failed",
            Self::Preempted => "it was preempted",
            Self::Timeout => "it reached its time limit",
            Self::OutOfMemory => "it ran out of memory",
            Self::Cancelled => "it was cancelled",
            Self::Start => "it ended before it began a run",
            Self::Failure => "it failed",
            Self::Lost => "the scheduler does not know of it any more",
        })
    }
}

/// How often a run is submitted again, by the cause of its end; a model that refuses inputs is not asked again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Retry {
    /// After a failure of the node.
    pub node_failure: usize,
    /// When the scheduler took the node for something else.
    pub preempted: usize,
    /// When the time limit was reached.
    pub timeout: usize,
    /// When memory ran out.
    pub out_of_memory: usize,
    /// When somebody cancelled the job.
    pub cancelled: usize,
    /// When a job ended by itself before it began a run, though others began theirs: a node that lacks something. After that the
    /// study stops, and no run is charged.
    pub start: usize,
    /// When the job ended without a word of the run, by an exit code or a signal.
    pub failure: usize,
    /// When the scheduler does not know of the job any more.
    pub lost: usize,
}

impl Default for Retry {
    fn default() -> Self {
        Self {
            node_failure: 3,
            preempted: 10,
            timeout: 0,
            out_of_memory: 0,
            cancelled: 0,
            start: 2,
            failure: 0,
            lost: 1,
        }
    }
}

impl Retry {
    /// How often a run is submitted again after this.
    pub fn after(&self, cause: Cause) -> usize {
        match cause {
            Cause::NodeFailure => self.node_failure,
            Cause::Preempted => self.preempted,
            Cause::Timeout => self.timeout,
            Cause::OutOfMemory => self.out_of_memory,
            Cause::Cancelled => self.cancelled,
            Cause::Start => self.start,
            Cause::Failure => self.failure,
            Cause::Lost => self.lost,
        }
    }
}

/// What a job that is submitted again gets more of.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Growth {
    /// The factor on the time limit after each time limit that was reached.
    pub time: Positive,
    /// The factor on the memory after each time that it ran out.
    pub memory: Positive,
}

impl Default for Growth {
    fn default() -> Self {
        let one = Positive::new(1.0).unwrap_or_else(|_| unreachable!("1 is positive"));
        Self { time: one, memory: one }
    }
}
