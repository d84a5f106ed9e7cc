//! Cache of the most recent results, for a few keys that are requested repeatedly.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// Number of results kept; a study has few blocks.
const MOST: usize = 16;

/// Values that were made from keys.
pub struct Memo<K, V>(Mutex<VecDeque<(K, Arc<V>)>>);

impl<K, V> Default for Memo<K, V> {
    fn default() -> Self {
        Self::new()
    }
}

impl<K, V> Memo<K, V> {
    /// Creates an empty cache.
    pub const fn new() -> Self {
        Self(Mutex::new(VecDeque::new()))
    }

    /// The value of the key that is `known`, or one that is made now with its key.
    pub fn get<E>(
        &self,
        known: impl Fn(&K) -> bool,
        make: impl FnOnce() -> Result<(K, V), E>,
    ) -> Result<Arc<V>, E> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, value)) = all.iter().find(|(key, _)| known(key)) {
            return Ok(value.clone());
        }
        let (key, value) = make()?;
        let value = Arc::new(value);
        if all.len() == MOST {
            all.pop_front();
        }
        all.push_back((key, value.clone()));
        Ok(value)
    }
}
