//! Trees as readable TOML 1.0.

/// A number as TOML writes it: the shortest text that reads back to the same bits.
pub fn float(x: f64) -> String {
    if x.is_finite() {
        format!("{x:?}")
    } else if x.is_nan() {
        "nan".to_owned()
    } else if x > 0.0 {
        "inf".to_owned()
    } else {
        "-inf".to_owned()
    }
}
