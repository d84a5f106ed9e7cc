//! Output of a process, of which the end is kept for messages.

use std::io::Read;
use std::sync::mpsc::{self, Receiver};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use super::tail;

/// Number of bytes at the end that are kept.
const REMEMBERED: usize = 4096;

/// The end of a process's output.
#[derive(Debug)]
pub struct Printed {
    end: Arc<Mutex<Vec<u8>>>,
    closed: Receiver<()>,
}

impl Printed {
    /// Reads an output to its end, in a thread.
    pub fn of(mut output: impl Read + Send + 'static) -> Self {
        let end = Arc::new(Mutex::new(Vec::new()));
        let (sender, closed) = mpsc::channel::<()>();
        let kept = Arc::clone(&end);
        thread::spawn(move || {
            // The channel closes when this is dropped.
            let _open = sender;
            let mut bytes = [0; REMEMBERED];
            while let Ok(count @ 1..) = output.read(&mut bytes) {
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                kept.extend_from_slice(&bytes[..count]);
                let surplus = kept.len().saturating_sub(REMEMBERED);
                kept.drain(..surplus);
            }
        });
        Self { end, closed }
    }

    /// The last lines, once the output is complete or one second has passed.
    pub fn tail(&self) -> String {
        let _ = self.closed.recv_timeout(Duration::from_secs(1));
        tail(&self.end.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// How a process ended, with the last lines that it printed.
pub fn ending(status: Option<std::process::ExitStatus>, printed: &Printed) -> String {
    let how = match status.map(|status| status.code()) {
        Some(Some(code)) => format!("ended with exit code {code}"),
        Some(None) => "was ended by a signal".to_owned(),
        None => "stopped answering".to_owned(),
    };
    match printed.tail() {
        said if said.is_empty() => how,
        said => format!("{how}; it said: {said}"),
    }
}
