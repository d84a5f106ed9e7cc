//! Windows of the warm-up, as in Stan.

/// Schedule of the warm-up.
///
/// The step size is tuned throughout. The metric is learnt between an initial phase, in which the chains find the
/// bulk, and a final one, in which the step size settles; it is replaced at the end of each window, and each window
/// is twice as long as the one before.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Windows {
    /// First step whose draw contributes to the metric.
    first: usize,
    /// Last step of each window.
    ends: Vec<usize>,
}

impl Windows {
    pub fn new(warm_up: usize) -> Self {
        let (first, last, base) = if warm_up >= 150 {
            (75, 50, 25)
        } else {
            let (first, last) = (warm_up * 15 / 100, warm_up / 10);
            (first, last, warm_up - first - last)
        };
        let close = warm_up - last;
        let (mut ends, mut begin, mut size) = (Vec::new(), first, base);
        while begin < close {
            // A window that leaves no room for the next one, twice as long, extends to the end.
            let end = if begin + 3 * size > close { close } else { begin + size };
            ends.push(end - 1);
            (begin, size) = (end, 2 * size);
        }
        Self { first, ends }
    }

    /// Returns true if the draw of this step contributes to the metric.
    pub fn measure(&self, step: usize) -> bool {
        step >= self.first && self.ends.last().is_some_and(|last| step <= *last)
    }

    /// Returns true if the metric is replaced after this step.
    pub fn end(&self, step: usize) -> bool {
        self.ends.contains(&step)
    }

    /// Returns true if the search for the step size restarts after this step.
    ///
    /// Unlike Stan, it does not restart after the last of several windows: the metric was nearly right before, and a
    /// new search oscillates so strongly in the few steps left that its average comes out too small.
    pub fn seek(&self, step: usize) -> bool {
        self.end(step) && (self.ends.len() == 1 || self.ends.last() != Some(&step))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_those_of_stan() {
        // Source: Stan reference manual, section 15.2: 75, then 25, 50, 100, 200, 500, then 50 of 1000 steps.
        let windows = Windows::new(1000);
        assert_eq!((windows.first, &windows.ends[..]), (75, &[99, 149, 249, 449, 949][..]));
        assert!(!windows.measure(74) && windows.measure(75) && windows.measure(949));
        assert!(!windows.measure(950) && windows.end(99) && !windows.end(100));
        assert!(windows.seek(449) && !windows.seek(949) && !windows.seek(450));
        assert!(Windows::new(150).seek(99));
        assert_eq!(Windows::new(150).ends, [99]);
        assert_eq!((Windows::new(100).first, Windows::new(100).ends), (15, vec![89]));
        assert_eq!(Windows::new(0).ends, Vec::<usize>::new());
    }
}
