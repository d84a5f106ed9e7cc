//! Causes of runs without a result, and the number of resubmissions for each.

use std::fmt;

use lacuna::text::values::Positive;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Cause of a job's end without a result of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The node failed.
    NodeFailure,
    /// The scheduler took the node for another job.
    Preempted,
    /// The time limit was reached.
    Timeout,
    /// The memory limit was reached.
    OutOfMemory,
    /// A user or administrator cancelled the job.
    Cancelled,
    /// The job ended before its first run began.
    Start,
    /// The job ended by itself, with an exit code or by a signal.
    Failure,
    /// The scheduler no longer knows the job, and it left no result.
    Lost,
}

impl Cause {
    /// Returns true if the cause affects all runs of a job, including those that had not begun.
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
            Self::Lost => "the scheduler has no record of it any more",
        })
    }
}

/// Number of times that a run is submitted again, by the cause of its end. A run whose inputs the model rejects is
/// not repeated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Retry {
    /// Resubmissions after a node failure.
    pub node_failure: usize,
    /// Resubmissions after preemption.
    pub preempted: usize,
    /// Resubmissions after the time limit was reached; see `grow` for a longer limit.
    pub timeout: usize,
    /// Resubmissions after memory ran out; see `grow` for more memory.
    pub out_of_memory: usize,
    /// Resubmissions after somebody cancelled the job.
    pub cancelled: usize,
    /// Resubmissions of a job that ended by itself before its first run began, although other jobs began theirs:
    /// something is missing on a node. If they are used up the study stops, and no run counts as failed.
    pub start: usize,
    /// Resubmissions after the job ended, by an exit code or a signal, without a result of the run.
    pub failure: usize,
    /// Resubmissions if the scheduler no longer knows the job.
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
    /// Returns the number of resubmissions for a cause.
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

/// Increase of the limits of a job that is submitted again.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Growth {
    /// Factor on the time limit for each time that it was reached.
    pub time: Positive,
    /// Factor on the memory for each time that it ran out.
    pub memory: Positive,
}

impl Default for Growth {
    fn default() -> Self {
        let one = Positive::new(1.0).unwrap_or_else(|_| unreachable!("1 is positive"));
        Self { time: one, memory: one }
    }
}
