//! The size of a change that is as large as requested.

/// The smallest size that is tried, relative to that of a start.
const SMALLEST: f64 = 1e-3;
/// The largest size that is tried, relative to that of a start.
const LARGEST: f64 = 1e6;
/// The number of bisections of the interval that holds the size.
const HALVINGS: usize = 30;

/// The change of the smallest size that reaches `ratio`; `at` returns what a size reaches, and what is made with it.
/// `None` if no size that `at` allows reaches it.
///
/// The change grows with the size: the size is doubled until the change is large enough, then the interval is bisected.
pub fn sized<T>(ratio: f64, at: impl Fn(f64) -> Option<(f64, T)>) -> Option<T> {
    let (mut small, mut large) = (0.0, SMALLEST);
    while at(large)?.0 < ratio {
        (small, large) = (large, 2.0 * large);
        if large > LARGEST {
            return None;
        }
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (small + large);
        if at(middle)?.0 < ratio {
            small = middle;
        } else {
            large = middle;
        }
    }
    at(large).map(|(_, made)| made)
}
