//! Progress of a run, reported to an observer.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// Receives progress, warnings and notes of a run.
pub trait Observer: Sync {
    /// A stage begins; `total` is the number of its units of work, or zero if they are not counted.
    fn begin(&self, stage: &str, unit: &str, total: u64);
    /// `done` further units of the current stage are complete.
    fn advance(&self, done: u64);
    /// The units of work of the current stage, as far as can be told by now: an estimate that may be revised, of a stage that
    /// began with a total of zero.
    fn expect(&self, _total: u64) {}
    /// The stage is complete; `note` summarises its result in a few words.
    fn end(&self, stage: &str, note: &str);
    /// A warning, which is part of the result.
    fn warn(&self, text: &str);
    /// A note that is no cause for concern.
    fn note(&self, _text: &str) {}
    /// A remark on this machine, these files or this attempt: it is shown, and is not part of the result.
    fn remark(&self, text: &str) {
        self.warn(text);
    }
    /// All warnings so far, if the observer collects them for the report.
    fn heard(&self) -> Vec<String> {
        Vec::new()
    }
    /// A warning of a stage whose kept result is reused, given when it was made.
    fn recall(&self, _text: &str) {}
}

/// Forwards everything to another observer and collects the warnings, which belong to the result as much as its
/// numbers.
pub struct Listener<'a> {
    observer: &'a dyn Observer,
    heard: Mutex<Vec<String>>,
}

impl<'a> Listener<'a> {
    /// A listener that has collected nothing yet.
    pub fn new(observer: &'a dyn Observer) -> Self {
        Self { observer, heard: Mutex::default() }
    }

    fn with<R>(&self, act: impl FnOnce(&mut Vec<String>) -> R) -> R {
        // A thread that panicked while it warned leaves the list usable, so a poisoned lock is accepted.
        act(&mut self.heard.lock().unwrap_or_else(std::sync::PoisonError::into_inner))
    }
}

impl Observer for Listener<'_> {
    fn begin(&self, stage: &str, unit: &str, total: u64) {
        self.observer.begin(stage, unit, total);
    }
    fn advance(&self, done: u64) {
        self.observer.advance(done);
    }
    fn expect(&self, total: u64) {
        self.observer.expect(total);
    }
    fn end(&self, stage: &str, note: &str) {
        self.observer.end(stage, note);
    }
    fn warn(&self, text: &str) {
        self.observer.warn(text);
        self.with(|heard| heard.push(text.to_owned()));
    }
    fn note(&self, text: &str) {
        self.observer.note(text);
    }
    fn remark(&self, text: &str) {
        self.observer.remark(text);
    }
    fn heard(&self) -> Vec<String> {
        self.with(|heard| heard.clone())
    }
    fn recall(&self, text: &str) {
        self.with(|heard| heard.push(text.to_owned()));
    }
}

/// An observer that ignores everything.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {
    fn begin(&self, _: &str, _: &str, _: u64) {}
    fn advance(&self, _: u64) {}
    fn end(&self, _: &str, _: &str) {}
    fn warn(&self, _: &str) {}
}

/// Counter of units of work, for the code that does the work.
pub struct Progress<'a> {
    observer: &'a dyn Observer,
    done: AtomicU64,
}

impl<'a> Progress<'a> {
    /// A counter at zero.
    pub fn new(observer: &'a dyn Observer) -> Self {
        Self { observer, done: AtomicU64::new(0) }
    }

    /// Adds completed units. May be called from any thread.
    pub fn add(&self, units: u64) {
        let done = self.done.fetch_add(units, Ordering::Relaxed) + units;
        self.observer.advance(done);
    }

    /// Tells the observer that about this share of the work is done by now, for a stage whose end is not known.
    pub fn estimate(&self, share: f64) {
        let done = self.done.load(Ordering::Relaxed);
        self.observer.expect((done as f64 / share).round() as u64);
    }

    /// Passes on a warning.
    pub fn warn(&self, text: &str) {
        self.observer.warn(text);
    }

    /// Passes on a remark; see [`Observer::remark`].
    pub fn remark(&self, text: &str) {
        self.observer.remark(text);
    }
}
