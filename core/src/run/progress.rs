//! Progress, told to whoever watches.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// Watches a run.
pub trait Observer: Sync {
    /// A stage begins; `total` is the number of its units of work, or zero when it has none.
    fn begin(&self, stage: &str, unit: &str, total: u64);
    /// So many units of the current stage are done.
    fn advance(&self, done: u64);
    /// The stage is over; `note` says in a few words what came out.
    fn end(&self, stage: &str, note: &str);
    /// Something a person should know.
    fn warn(&self, text: &str);
    /// Something worth telling that is no reason for concern.
    fn note(&self, _text: &str) {}
    /// Something about this machine, these files or this attempt: it is told, and is no part of the result.
    fn remark(&self, text: &str) {
        self.warn(text);
    }
    /// Every warning so far, where someone listens for the report.
    fn heard(&self) -> Vec<String> {
        Vec::new()
    }
    /// A warning of a stage that is kept, given when it was made.
    fn recall(&self, _text: &str) {}
}

/// Passes everything on and remembers the warnings, which belong to the result as much as its numbers.
pub struct Listener<'a> {
    observer: &'a dyn Observer,
    heard: Mutex<Vec<String>>,
}

impl<'a> Listener<'a> {
    /// Has heard nothing yet.
    pub fn new(observer: &'a dyn Observer) -> Self {
        Self { observer, heard: Mutex::default() }
    }

    fn with<R>(&self, act: impl FnOnce(&mut Vec<String>) -> R) -> R {
        // A thread that panicked while it warned spoils nothing here.
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

/// Watches nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {
    fn begin(&self, _: &str, _: &str, _: u64) {}
    fn advance(&self, _: u64) {}
    fn end(&self, _: &str, _: &str) {}
    fn warn(&self, _: &str) {}
}

/// A counter of units of work, for code that does the work.
pub struct Progress<'a> {
    observer: &'a dyn Observer,
    done: AtomicU64,
}

impl<'a> Progress<'a> {
    /// A counter at zero.
    pub fn new(observer: &'a dyn Observer) -> Self {
        Self { observer, done: AtomicU64::new(0) }
    }

    /// So many more units are done. May be called from any thread.
    pub fn add(&self, units: u64) {
        let done = self.done.fetch_add(units, Ordering::Relaxed) + units;
        self.observer.advance(done);
    }

    /// Something a person should know.
    pub fn warn(&self, text: &str) {
        self.observer.warn(text);
    }

    /// See [`Observer::remark`].
    pub fn remark(&self, text: &str) {
        self.observer.remark(text);
    }
}
