//! Progress, told to whoever watches.

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
}
