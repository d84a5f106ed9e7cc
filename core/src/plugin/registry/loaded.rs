//! Plugins that are no part of the program: of libraries that were loaded, and those that a library is said to hold.

use std::any::Any;
use std::cell::RefCell;
use std::sync::{PoisonError, RwLock};

use super::Entry;

/// An entry of whatever kind.
pub(crate) type AnyEntry = &'static (dyn Any + Send + Sync);

/// The entries of all libraries that were loaded, for as long as the process lives.
static LOADED: RwLock<Vec<AnyEntry>> = RwLock::new(Vec::new());

thread_local! {
    /// The entries of libraries that are looked at without being loaded.
    static DECLARED: RefCell<Vec<AnyEntry>> = const { RefCell::new(Vec::new()) };
}

/// The entries of a kind.
pub(super) fn entries<K: ?Sized + 'static>() -> Vec<&'static Entry<K>> {
    let mut all: Vec<AnyEntry> = LOADED.read().unwrap_or_else(PoisonError::into_inner).clone();
    DECLARED.with_borrow(|declared| all.extend(declared));
    all.into_iter().filter_map(|entry| entry.downcast_ref::<Entry<K>>()).collect()
}

/// Adds entries for good.
pub(crate) fn add(entries: Vec<AnyEntry>) {
    LOADED.write().unwrap_or_else(PoisonError::into_inner).extend(entries);
}

/// Looks with further entries that this thread alone sees, and only meanwhile.
pub(crate) fn declaring<R>(entries: Vec<AnyEntry>, look: impl FnOnce() -> R) -> R {
    struct Before(Vec<AnyEntry>);
    impl Drop for Before {
        fn drop(&mut self) {
            DECLARED.set(std::mem::take(&mut self.0));
        }
    }
    let before = DECLARED.take();
    let all = before.iter().copied().chain(entries).collect();
    DECLARED.set(all);
    let _before = Before(before);
    look()
}
