//! Progress of a run in another thread, and its interruption.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use lacuna::run::Observer;

/// What a run says.
pub enum Event {
    /// A stage begins: name, unit of its work, number of units or zero.
    Begin(String, String, u64),
    /// Number of units that are done.
    Advance(u64),
    /// Estimate of the number of units of a stage that began with zero.
    Expect(u64),
    /// A stage ends: name and result in a few words.
    End(String, String),
    /// A warning, a note or a remark.
    Say(&'static str, String),
}

/// The panic that ends an interrupted run.
pub struct Interrupted;

/// Passes what a run says to the thread that waits for it.
pub struct Channel {
    events: Mutex<Sender<Event>>,
    interrupted: Arc<AtomicBool>,
    spoken: Mutex<Instant>,
}

/// Least time between two reports of progress.
const INTERVAL: Duration = Duration::from_millis(50);

impl Channel {
    /// A channel to the waiting thread, which sets `interrupted` to end the run.
    pub fn new(events: Sender<Event>, interrupted: Arc<AtomicBool>) -> Self {
        Self { events: Mutex::new(events), interrupted, spoken: Mutex::new(Instant::now()) }
    }

    fn send(&self, event: Event) {
        if self.interrupted.load(Ordering::Relaxed) {
            // Every stage can be ended at any point; no message is printed for this panic.
            resume_unwind(Box::new(Interrupted));
        }
        // Nobody listens after the end of the waiting thread.
        let _ = self.events.lock().unwrap_or_else(PoisonError::into_inner).send(event);
    }
}

impl Observer for Channel {
    fn begin(&self, stage: &str, unit: &str, total: u64) {
        self.send(Event::Begin(stage.to_owned(), unit.to_owned(), total));
    }

    fn advance(&self, done: u64) {
        let now = Instant::now();
        let due = {
            let mut spoken = self.spoken.lock().unwrap_or_else(PoisonError::into_inner);
            let due = now.duration_since(*spoken) > INTERVAL;
            if due {
                *spoken = now;
            }
            due
        };
        if due || self.interrupted.load(Ordering::Relaxed) {
            self.send(Event::Advance(done));
        }
    }

    fn expect(&self, total: u64) {
        self.send(Event::Expect(total));
    }

    fn end(&self, stage: &str, note: &str) {
        self.send(Event::End(stage.to_owned(), note.to_owned()));
    }

    fn warn(&self, text: &str) {
        self.send(Event::Say("warning", text.to_owned()));
    }

    fn note(&self, text: &str) {
        self.send(Event::Say("note", text.to_owned()));
    }

    fn remark(&self, text: &str) {
        self.send(Event::Say("remark", text.to_owned()));
    }
}
