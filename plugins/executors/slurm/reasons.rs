//! Reasons for which Slurm lets a job wait.

/// Reasons that disappear by themselves as the queue advances.
const PASSING: [&str; 16] = [
    "",
    "None",
    "Priority",
    "Resources",
    "JobArrayTaskLimit",
    "BeginTime",
    "Cleaning",
    "Prolog",
    "Licenses",
    "Dependency",
    "WaitingForScheduling",
    "FedJobLock",
    "ScheduleLimit",
    "Reboot",
    "NodeBooting",
    "BurstBufferStageIn",
];

/// Explanations of other reasons, by their beginnings.
const MEANING: [(&str, &str); 17] = [
    ("BadConstraints", "no node has what the job asks for"),
    ("PartitionTimeLimit", "`time` is more than the partition allows"),
    ("PartitionNodeLimit", "`nodes` are more than the partition allows"),
    ("PartitionDown", "the partition takes no jobs now"),
    ("PartitionInactive", "the partition starts no jobs now"),
    ("ReqNodeNotAvail", "nodes that it needs are down or reserved"),
    ("NodeDown", "a node that it needs is down"),
    ("Nodes required", "nodes that it needs are down or reserved"),
    ("JobHeldUser", "it is held: `scontrol release` lets it go"),
    ("JobHeldAdmin", "an administrator holds it"),
    ("DependencyNeverSatisfied", "a job that it depends on has failed"),
    ("launch failed", "it could not be started on its node, and is held"),
    ("InvalidAccount", "the account may not be used"),
    ("InvalidQOS", "the quality of service may not be used"),
    ("Reservation", "its reservation has not begun, or is gone"),
    ("Assoc", "a limit of the account is reached"),
    ("QOS", "a limit of the quality of service is reached"),
];

/// Returns true if a job with this reason only waits for its turn.
pub fn is_passing(reason: &str) -> bool {
    PASSING.contains(&reason)
}

/// Returns the reason, with its explanation if known.
pub fn explained(reason: &str) -> String {
    let known = MEANING.iter().find(|(begin, _)| reason.starts_with(begin));
    known.map_or_else(|| reason.to_owned(), |(_, meaning)| format!("{reason}: {meaning}"))
}
