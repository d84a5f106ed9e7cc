//! Plugins that are not built in: those of loaded libraries, and those that a library declares.

use std::any::Any;
use std::cell::RefCell;
use std::sync::{PoisonError, RwLock};

use super::Entry;

/// An entry of any kind.
pub type AnyEntry = &'static (dyn Any + Send + Sync);

/// Entries of all loaded files, each with the file from which it comes.
static LOADED: RwLock<Vec<(String, AnyEntry)>> = RwLock::new(Vec::new());

thread_local! {
    /// Entries of libraries that are inspected without being loaded.
    static DECLARED: RefCell<Vec<AnyEntry>> = const { RefCell::new(Vec::new()) };
}

/// Entries of a kind.
pub(super) fn entries<K: ?Sized + 'static>() -> Vec<&'static Entry<K>> {
    let loaded = LOADED.read().unwrap_or_else(PoisonError::into_inner);
    let mut all: Vec<AnyEntry> = loaded.iter().map(|(_, entry)| *entry).collect();
    drop(loaded);
    DECLARED.with_borrow(|declared| all.extend(declared));
    all.into_iter().filter_map(|entry| entry.downcast_ref::<Entry<K>>()).collect()
}

/// Adds the entries of a file.
pub fn add(file: &str, entries: Vec<AnyEntry>) {
    let entries = entries.into_iter().map(|entry| (file.to_owned(), entry));
    LOADED.write().unwrap_or_else(PoisonError::into_inner).extend(entries);
}

/// Removes the entries of a file, whose plugins are no longer found; those in use stay as they are.
pub fn remove(file: &str) -> Vec<AnyEntry> {
    let mut loaded = LOADED.write().unwrap_or_else(PoisonError::into_inner);
    let removed = loaded.iter().filter(|(from, _)| from == file).map(|(_, entry)| *entry).collect();
    loaded.retain(|(from, _)| from != file);
    removed
}

/// Runs `look` with further entries that only this thread sees, and only during the call.
pub fn declaring<R>(entries: Vec<AnyEntry>, look: impl FnOnce() -> R) -> R {
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
