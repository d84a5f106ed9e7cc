//! Detection of processes that the operating system killed for lack of memory.

use std::fs;
use std::path::PathBuf;

/// Number of processes that the operating system has killed for lack of memory among those that share the limits of
/// this one; `None` if it is not counted. A simulator killed in this way ends by a signal like any other.
pub fn killed() -> Option<u64> {
    let groups = fs::read_to_string("/proc/self/cgroup").ok()?;
    let text = files(&groups).into_iter().find_map(|file| fs::read_to_string(file).ok())?;
    count(&text)
}

/// Files in which the number may be found, the dedicated memory hierarchy first.
fn files(groups: &str) -> Vec<PathBuf> {
    let of = |line: &str| {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, path) = (parts.next()?, parts.next()?.trim_start_matches('/'));
        let root = PathBuf::from("/sys/fs/cgroup");
        match controllers {
            "" => Some((1, root.join(path).join("memory.events"))),
            _ if controllers.split(',').any(|name| name == "memory") => {
                Some((0, root.join("memory").join(path).join("memory.oom_control")))
            }
            _ => None,
        }
    };
    let mut found: Vec<(u8, PathBuf)> = groups.lines().filter_map(of).collect();
    found.sort();
    found.into_iter().map(|(_, file)| file).collect()
}

fn count(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix("oom_kill "))?;
    line.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_kinds_of_groups_are_understood() {
        let first = files("9:name=systemd:/\n4:memory:/slurm/job_1/task_0\n0::/\n");
        let own = "/sys/fs/cgroup/memory/slurm/job_1/task_0/memory.oom_control";
        assert_eq!(first[0], PathBuf::from(own));
        let second = files("0::/system.slice/job_1\n");
        assert_eq!(second, [PathBuf::from("/sys/fs/cgroup/system.slice/job_1/memory.events")]);
        assert_eq!(count("oom_kill_disable 0\nunder_oom 0\noom_kill 2\n"), Some(2));
        assert_eq!(count("low 0\noom 1\noom_kill 1\noom_group_kill 0\n"), Some(1));
        assert_eq!(count("under_oom 0\n"), None);
    }
}
