//! Processes of simulators: each is one group with all that it starts, and is ended as a whole.
//!
//! A process that puts itself into a session of its own leaves its group and is not ended with it.

mod guard;
mod program;
mod tail;

use std::io;
use std::process::{Child, Command, ExitStatus};
use std::thread;
use std::time::{Duration, Instant};

pub use program::find;
pub use tail::{tail, tail_of_file};

/// A running process and all that it has started.
#[derive(Debug)]
pub struct Process {
    child: Child,
    /// How the process ended, once it has.
    status: Option<ExitStatus>,
}

impl Process {
    /// Starts a command as a group of its own.
    pub fn start(command: &mut Command) -> io::Result<Self> {
        group::lead(command);
        let child = command.spawn()?;
        guard::watch(child.id());
        Ok(Self { child, status: None })
    }

    /// The process, for its pipes.
    pub fn child(&mut self) -> &mut Child {
        &mut self.child
    }

    /// Whether the process has not ended.
    pub fn is_running(&mut self) -> bool {
        self.status.is_none() && group::leader_has_ended(&mut self.child).is_ok_and(|ended| !ended)
    }

    /// Waits until the process has ended, then ends whatever it left running; `None` when the time is up and
    /// all of it was ended.
    pub fn wait(&mut self, limit: Option<Duration>) -> io::Result<Option<ExitStatus>> {
        let begun = Instant::now();
        let mut in_time = true;
        while self.status.is_none() && !group::leader_has_ended(&mut self.child)? {
            let passed = begun.elapsed();
            if limit.is_some_and(|limit| passed >= limit) {
                in_time = false;
                break;
            }
            thread::sleep(pause(passed));
        }
        let status = self.end()?;
        Ok(in_time.then_some(status))
    }

    /// Ends the process and all that it has started.
    pub fn end(&mut self) -> io::Result<ExitStatus> {
        if let Some(status) = self.status {
            return Ok(status);
        }
        // The leader is not yet waited for, so that its number still stands for this group and no other.
        group::kill(&mut self.child);
        guard::release(self.child.id());
        let status = self.child.wait()?;
        self.status = Some(status);
        Ok(status)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.end();
    }
}

/// How long to sleep between two looks: a twentieth of the time that has passed, so that little is added to it.
fn pause(passed: Duration) -> Duration {
    (passed / 20).clamp(Duration::from_micros(200), Duration::from_millis(20))
}

#[cfg(unix)]
mod group {
    use std::io;
    use std::os::unix::process::CommandExt as _;
    use std::process::{Child, Command};

    use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};

    pub fn lead(command: &mut Command) {
        command.process_group(0);
    }

    pub fn leader_has_ended(child: &mut Child) -> io::Result<bool> {
        let look = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        Ok(waitid(WaitId::Pid(Pid::from_child(child)), look)?.is_some())
    }

    pub fn kill(child: &mut Child) {
        // An error means that no process of the group is left.
        let _ = kill_process_group(Pid::from_child(child), Signal::KILL);
    }
}

#[cfg(not(unix))]
mod group {
    use std::io;
    use std::process::{Child, Command};

    pub fn lead(_: &mut Command) {}

    pub fn leader_has_ended(child: &mut Child) -> io::Result<bool> {
        Ok(child.try_wait()?.is_some())
    }

    pub fn kill(child: &mut Child) {
        // An error means that the process has ended.
        let _ = child.kill();
    }
}

#[cfg(all(test, unix))]
mod tests;
