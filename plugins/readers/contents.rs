//! Parts shared by the readers' `inspect`.

/// Maximum number of values of one variable that `inspect` keeps as columns; a larger variable is only described.
pub const MOST_SIGNAL_VALUES: usize = 4_000_000;

/// Builds a fact about a file.
pub fn fact(name: &str, value: impl ToString) -> (String, String) {
    (name.to_owned(), value.to_string())
}

/// Returns the smallest and largest finite value, and the number of values that are not finite.
pub fn limits(values: &[f64]) -> (Option<(f64, f64)>, usize) {
    let finite = || values.iter().copied().filter(|x| x.is_finite());
    let range = finite().fold(None, |range: Option<(f64, f64)>, x| {
        Some(range.map_or((x, x), |(low, high)| (low.min(x), high.max(x))))
    });
    (range, values.len() - finite().count())
}
