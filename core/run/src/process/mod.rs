//! Processes of simulators and plugins: each is started as a process group with all its descendants, and the group is ended as a
//! whole.
//!
//! A descendant that starts a session of its own leaves the group and is not ended with it.

mod guard;
mod printed;
mod program;
mod tail;

use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};
use std::{io, thread};

pub use printed::{Printed, ending};
pub use program::{find, interpreter, keep_freed_memory};
pub use tail::{tail, tail_of_file};

/// The time a process that was asked to end (SIGTERM) leaves to this program, to be asked as well.
const GRACE: Duration = Duration::from_secs(3);

/// How a process ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// By itself.
    Itself(ExitStatus),
    /// At its time limit.
    Late,
    /// Because it was not to go on.
    Stopped,
}

/// A running process with all its descendants.
#[derive(Debug)]
pub struct Process {
    child: Child,
    /// Exit status of the process, once it has ended.
    status: Option<ExitStatus>,
}

impl Process {
    /// Starts a command in a process group of its own.
    pub fn start(command: &mut Command) -> io::Result<Self> {
        group::lead(command);
        guard::ready();
        let child = command.spawn()?;
        guard::watch(child.id());
        Ok(Self { child, status: None })
    }

    /// The process, for access to its pipes.
    pub fn child(&mut self) -> &mut Child {
        &mut self.child
    }

    /// Returns `true` while the process has not ended.
    pub fn is_running(&mut self) -> bool {
        self.status.is_none() && group::leader_has_ended(&mut self.child).is_ok_and(|ended| !ended)
    }

    /// Waits until the process has ended, then ends all processes of its group that still run. Returns `None` if
    /// `limit` passes first; the whole group is then ended.
    pub fn wait(&mut self, limit: Option<Duration>) -> io::Result<Option<ExitStatus>> {
        let end = self.wait_while(limit, || true)?;
        Ok(match end {
            End::Itself(status) => Some(status),
            End::Late | End::Stopped => None,
        })
    }

    /// Like [`Process::wait`], but ends the group also as soon as `may_go_on` returns false; it is asked again and again.
    pub fn wait_while(
        &mut self,
        limit: Option<Duration>,
        may_go_on: impl Fn() -> bool,
    ) -> io::Result<End> {
        let begun = Instant::now();
        let mut cut = None;
        while self.status.is_none() && !group::leader_has_ended(&mut self.child)? {
            let passed = begun.elapsed();
            if limit.is_some_and(|limit| passed >= limit) {
                cut = Some(End::Late);
                break;
            }
            if !may_go_on() {
                cut = Some(End::Stopped);
                break;
            }
            thread::sleep(pause(passed));
        }
        let status = self.end()?;
        if cut.is_none() && group::was_asked_to_end(status) {
            // A scheduler that ends a job signals its processes one after the other. This one may be the next: it must not
            // first report that the simulator failed, where the job reached its time limit.
            thread::sleep(GRACE);
        }
        Ok(cut.unwrap_or(End::Itself(status)))
    }

    /// Ends the process and its whole group.
    pub fn end(&mut self) -> io::Result<ExitStatus> {
        if let Some(status) = self.status {
            return Ok(status);
        }
        // The leader is not yet waited for, so that its process id still identifies this group and no other.
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

/// Pause between two checks: a twentieth of the time that has passed, so that waiting adds little to it; between 0.2
/// and 20 ms.
fn pause(passed: Duration) -> Duration {
    (passed / 20).clamp(Duration::from_micros(200), Duration::from_millis(20))
}

#[cfg(unix)]
mod group {
    use std::io;
    use std::os::unix::process::{CommandExt as _, ExitStatusExt as _};
    use std::process::{Child, Command, ExitStatus};

    use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};

    pub fn lead(command: &mut Command) {
        command.process_group(0);
    }

    pub fn leader_has_ended(child: &mut Child) -> io::Result<bool> {
        let look = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        Ok(waitid(WaitId::Pid(Pid::from_child(child)), look)?.is_some())
    }

    pub fn was_asked_to_end(status: ExitStatus) -> bool {
        status.signal() == Some(Signal::TERM.as_raw())
    }

    pub fn kill(child: &mut Child) {
        // An error means that no process of the group is left.
        let _ = kill_process_group(Pid::from_child(child), Signal::KILL);
    }
}

#[cfg(not(unix))]
mod group {
    use std::io;
    use std::process::{Child, Command, ExitStatus};

    pub fn lead(_: &mut Command) {}

    pub fn leader_has_ended(child: &mut Child) -> io::Result<bool> {
        Ok(child.try_wait()?.is_some())
    }

    pub fn was_asked_to_end(_: ExitStatus) -> bool {
        false
    }

    pub fn kill(child: &mut Child) {
        // An error means that the process has ended.
        let _ = child.kill();
    }
}

#[cfg(all(test, unix))]
mod tests;
