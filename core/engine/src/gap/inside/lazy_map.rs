//! Values by sets of pieces, each made at its first use.

use std::sync::OnceLock;

/// Values by sets of pieces. A value stays where it is while others are added, so that it can be borrowed as long as the
/// map.
pub struct LazyMap<T> {
    first: OnceLock<Box<Entry<T>>>,
}

struct Entry<T> {
    pieces: Vec<usize>,
    value: OnceLock<T>,
    next: OnceLock<Box<Entry<T>>>,
}

impl<T> LazyMap<T> {
    /// A map without values.
    pub fn new() -> Self {
        Self { first: OnceLock::new() }
    }

    /// The value of these pieces; `make` makes it if there is none.
    pub fn get_or_make(&self, pieces: &[usize], make: impl FnOnce() -> T) -> &T {
        let mut place = &self.first;
        loop {
            let fresh =
                || Entry { pieces: pieces.to_vec(), value: OnceLock::new(), next: OnceLock::new() };
            let entry = place.get_or_init(|| Box::new(fresh()));
            if entry.pieces == pieces {
                return entry.value.get_or_init(make);
            }
            place = &entry.next;
        }
    }

    /// The values made so far.
    pub fn values(&self) -> impl Iterator<Item = &T> {
        let entries = std::iter::successors(self.first.get(), |entry| entry.next.get());
        entries.filter_map(|entry| entry.value.get())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn each_set_has_one_value_whoever_asks_first() {
        let (map, made) = (LazyMap::new(), AtomicUsize::new(0));
        let of = |i: usize| vec![i % 10, 10 + i % 7, 20];
        let all: Vec<usize> = (0..1000)
            .into_par_iter()
            .map(|i| {
                *map.get_or_make(&of(i), || {
                    made.fetch_add(1, Ordering::Relaxed);
                    i % 70
                })
            })
            .collect();
        assert!(all.iter().enumerate().all(|(i, value)| *value == i % 70));
        assert_eq!(made.load(Ordering::Relaxed), 70);
        assert_eq!(map.values().count(), 70);
    }
}
