//! Guard that ends the simulators' processes when this program is killed: a shell that waits for the end of a pipe.
//!
//! The terminal's interrupt does not reach a separate process group, and a killed program cannot clean up. The shell
//! receives the ids of the running groups; when the pipe closes, for any reason, it ends those that are left.

use std::io::Write as _;
use std::process::{ChildStdin, Command, Stdio};
use std::sync::{Mutex, OnceLock, PoisonError};

pub(super) const SCRIPT: &str = "\
groups=' '
while read -r change group; do
    case $change in
        +) groups=\"$groups$group \" ;;
        -) groups=\"${groups%% $group *} ${groups#* $group }\" ;;
    esac
done
for group in $groups; do kill -s KILL -- \"-$group\" 2>/dev/null; done
";

static GUARD: OnceLock<Option<Mutex<ChildStdin>>> = OnceLock::new();

/// Starts the guard, if it is not running: a group that begins before its guard would run on after a kill in between.
pub fn ready() {
    GUARD.get_or_init(start);
}

/// Registers a running group.
pub fn watch(group: u32) {
    tell('+', group);
}

/// Removes a group that has ended.
pub fn release(group: u32) {
    tell('-', group);
}

fn tell(change: char, group: u32) {
    let Some(pipe) = GUARD.get_or_init(start) else { return };
    let mut pipe = pipe.lock().unwrap_or_else(PoisonError::into_inner);
    // A run is possible without the guard.
    let _ = pipe.write_all(format!("{change} {group}\n").as_bytes());
}

/// Starts the guard and returns its pipe; `None` where there is no shell.
fn start() -> Option<Mutex<ChildStdin>> {
    if !cfg!(unix) {
        return None;
    }
    let mut command = Command::new("/bin/sh");
    command.args(["-c", SCRIPT]).current_dir("/");
    command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null());
    super::group::lead(&mut command);
    command.spawn().ok()?.stdin.map(Mutex::new)
}
