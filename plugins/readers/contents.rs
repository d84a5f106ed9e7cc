//! What the readers' `inspect` has in common.

/// How many values `inspect` keeps as columns of one variable; a larger one is only described.
pub const MOST_SIGNAL_VALUES: usize = 4_000_000;

/// A fact about a file.
pub fn fact(name: &str, value: impl ToString) -> (String, String) {
    (name.to_owned(), value.to_string())
}

/// Smallest and largest finite value, and how many are not finite.
pub fn limits(values: &[f64]) -> (Option<(f64, f64)>, usize) {
    let finite = || values.iter().copied().filter(|x| x.is_finite());
    let range = finite().fold(None, |range: Option<(f64, f64)>, x| {
        Some(range.map_or((x, x), |(low, high)| (low.min(x), high.max(x))))
    });
    (range, values.len() - finite().count())
}
