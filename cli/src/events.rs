//! Events for programs: with `--events` all that a command says is JSON, one object a line, on standard output.

use std::io::Write as _;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use lacuna::run::Observer;
use serde_json::{Value, json};

/// True if events are written in place of text for people.
static ON: AtomicBool = AtomicBool::new(false);

/// Shortest time between two events of progress.
const INTERVAL: Duration = Duration::from_millis(500);

/// Writes events from now on.
pub fn turn_on() {
    ON.store(true, Ordering::Relaxed);
}

/// True if events are written.
pub fn are_on() -> bool {
    ON.load(Ordering::Relaxed)
}

/// Writes an event.
pub fn write(event: &Value) {
    let mut out = std::io::stdout().lock();
    let written = writeln!(out, "{event}").and_then(|()| out.flush());
    crate::terminal::note(written);
}

/// Text that a command prints for people.
pub fn text(text: &str) {
    if !text.is_empty() {
        write(&json!({ "event": "text", "text": text }));
    }
}

/// Files of a finished run.
pub fn result(run: &Path) {
    let [report, summary] = ["report.html", "summary.json"].map(|file| run.join(file));
    write(&json!({ "event": "result", "run": run, "report": report, "summary": summary }));
}

/// End of the command, with its exit code and the error that ended it.
pub fn end(code: u8, error: Option<&str>) {
    write(&json!({ "event": "end", "code": code, "error": error }));
}

/// Progress of a command as events.
#[derive(Default)]
pub struct Events {
    current: Mutex<Option<Current>>,
}

struct Current {
    stage: String,
    done: u64,
    total: u64,
    /// True if the total is an estimate.
    about: bool,
    begun: Instant,
    spoken: Instant,
}

impl Current {
    fn tell(&mut self) {
        self.spoken = Instant::now();
        let seconds = self.begun.elapsed().as_secs_f64();
        let Self { stage, done, total, about, .. } = self;
        write(&json!({
            "event": "progress", "stage": stage, "done": done, "total": total, "about": about,
            "seconds": seconds
        }));
    }
}

impl Events {
    fn with<R>(&self, act: impl FnOnce(&mut Option<Current>) -> R) -> R {
        act(&mut self.current.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Observer for Events {
    fn begin(&self, stage: &str, unit: &str, total: u64) {
        write(&json!({ "event": "begin", "stage": stage, "unit": unit, "total": total }));
        let now = Instant::now();
        let current = Current {
            stage: stage.to_owned(),
            done: 0,
            total,
            about: false,
            begun: now,
            spoken: now,
        };
        self.with(|slot| *slot = Some(current));
    }

    fn advance(&self, done: u64) {
        self.with(|slot| {
            let Some(current) = slot else { return };
            current.done = current.done.max(done);
            if current.spoken.elapsed() >= INTERVAL {
                current.tell();
            }
        });
    }

    fn expect(&self, total: u64) {
        self.with(|slot| {
            let Some(current) = slot else { return };
            (current.total, current.about) = (total, true);
            current.tell();
        });
    }

    fn end(&self, stage: &str, note: &str) {
        let current = self.with(Option::take);
        let seconds = current.map_or(0.0, |current| current.begun.elapsed().as_secs_f64());
        write(&json!({ "event": "done", "stage": stage, "seconds": seconds, "note": note }));
    }

    fn warn(&self, text: &str) {
        write(&json!({ "event": "warning", "text": text }));
    }

    fn note(&self, text: &str) {
        write(&json!({ "event": "note", "text": text }));
    }
}
