//! Time that the density of a point takes, which tells if the points of a batch are worth the threads.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Time of a batch below which waking another thread costs more than it saves.
const SHORT: Duration = Duration::from_micros(100);

/// Time that the last blocks of points took. It decides where densities are computed, never their values.
#[derive(Debug, Default)]
pub struct Pace {
    /// Nanoseconds a point, those of the slowest of the last blocks; zero as long as nothing was measured.
    nanoseconds: AtomicU64,
}

impl Pace {
    /// Returns true if this number of points is known to be computed in a short time.
    pub fn is_short(&self, points: usize) -> bool {
        let each = self.nanoseconds.load(Ordering::Relaxed);
        each > 0 && each.saturating_mul(points as u64) < SHORT.as_nanos() as u64
    }

    /// Computes the densities of a block and remembers the time.
    pub fn of<T>(&self, points: usize, compute: impl FnOnce() -> T) -> T {
        let begun = Instant::now();
        let computed = compute();
        let each = begun.elapsed().as_nanos() / points.max(1) as u128;
        let each = u64::try_from(each).unwrap_or(u64::MAX).max(1);
        // A block outside the prior takes no time and says nothing of the next one.
        let before = self.nanoseconds.load(Ordering::Relaxed);
        self.nanoseconds.store(each.max(before - before / 4), Ordering::Relaxed);
        computed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_measured_or_took_long_is_not_short() {
        let pace = Pace::default();
        assert!(!pace.is_short(1));
        pace.of(1000, || ());
        assert!(pace.is_short(1));
        pace.of(1, || std::thread::sleep(Duration::from_millis(1)));
        assert!(!pace.is_short(1));
        pace.of(1000, || ());
        assert!(!pace.is_short(1), "one fast block after a slow one");
        (0..40).for_each(|_| pace.of(1000, || ()));
        assert!(pace.is_short(1));
    }
}
