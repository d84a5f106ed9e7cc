//! Limits on a worker's use of its machine.

use lacuna::run::Stop;

/// Limits that a process imposes on itself and on all processes that it starts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Limits {
    /// Share of the processors, as (index, number of equal parts).
    pub part: Option<(usize, usize)>,
    /// Memory that may be allocated, in bytes.
    pub memory: Option<u64>,
}

impl Limits {
    /// Imposes the limits on this process.
    pub fn apply(self) -> Result<(), Stop> {
        if let Some((part, parts)) = self.part {
            system::pin(part, parts)?;
        }
        self.memory.map_or(Ok(()), system::limit_memory)
    }

    /// Returns true if this operating system supports the limits.
    pub const fn are_known() -> bool {
        cfg!(target_os = "linux")
    }
}

/// Processors of one of `parts` equal parts, at least one each: with more parts than processors, parts share
/// processors.
#[cfg_attr(not(target_os = "linux"), expect(dead_code, reason = "only Linux pins"))]
fn share(processors: &[usize], part: usize, parts: usize) -> Vec<usize> {
    let all = processors.len();
    if all == 0 || parts == 0 {
        return Vec::new();
    }
    if parts >= all {
        return vec![processors[part % all]];
    }
    processors[part * all / parts..(part + 1) * all / parts].to_vec()
}

#[cfg(target_os = "linux")]
mod system {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

    use super::{Stop, share};

    pub fn pin(part: usize, parts: usize) -> Result<(), Stop> {
        let failed = |error| Stop::new(format!("cannot pin a process: {error}"));
        let allowed = sched_getaffinity(None).map_err(failed)?;
        let processors: Vec<usize> = (0..CpuSet::MAX_CPU).filter(|&i| allowed.is_set(i)).collect();
        let mut set = CpuSet::new();
        for processor in share(&processors, part, parts) {
            set.set(processor);
        }
        sched_setaffinity(None, &set).map_err(failed)
    }

    pub fn limit_memory(bytes: u64) -> Result<(), Stop> {
        // The limit is on allocated memory, not on mapped memory: threads map far more than they use.
        let most = getrlimit(Resource::Data).maximum;
        let bytes = most.map_or(bytes, |most| most.min(bytes));
        setrlimit(Resource::Data, Rlimit { current: Some(bytes), maximum: most })
            .map_err(|error| Stop::new(format!("cannot limit the memory of a process: {error}")))
    }
}

#[cfg(not(target_os = "linux"))]
mod system {
    use super::Stop;

    pub fn pin(_: usize, _: usize) -> Result<(), Stop> {
        Err(Stop::new("processes cannot be pinned on this system"))
    }

    pub fn limit_memory(_: u64) -> Result<(), Stop> {
        Err(Stop::new("the memory of a process cannot be limited on this system"))
    }
}

#[cfg(test)]
mod tests {
    use super::share;

    #[test]
    fn parts_are_disjoint_and_cover_all_processors() {
        let all = [2, 3, 5, 7, 8];
        let parts: Vec<Vec<usize>> = (0..2).map(|part| share(&all, part, 2)).collect();
        assert_eq!(parts.concat(), all);
        assert_eq!(parts[0].len(), 2);
        let taken: Vec<usize> = (0..7).flat_map(|part| share(&all, part, 7)).collect();
        assert_eq!(taken, [2, 3, 5, 7, 8, 2, 3]);
    }
}
