//! Ends the processes of simulators when this program is killed: a shell that waits for the end of a pipe.
//!
//! A group of its own is not reached by the terminal's interrupt, and nothing runs in a killed program. The
//! shell is told which groups are running; when the pipe closes, for whatever reason, it ends those that are left.

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

/// Notes that a group runs.
pub fn watch(group: u32) {
    tell('+', group);
}

/// Notes that a group has ended.
pub fn release(group: u32) {
    tell('-', group);
}

fn tell(change: char, group: u32) {
    static GUARD: OnceLock<Option<Mutex<ChildStdin>>> = OnceLock::new();
    let Some(pipe) = GUARD.get_or_init(start) else { return };
    let mut pipe = pipe.lock().unwrap_or_else(PoisonError::into_inner);
    // Without its guard a run is made all the same.
    let _ = pipe.write_all(format!("{change} {group}\n").as_bytes());
}

/// The pipe to the guard; `None` where there is no shell.
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
