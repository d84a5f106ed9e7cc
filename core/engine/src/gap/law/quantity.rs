//! Numbers with units in expressions.

use lacuna::data::Unit;

/// The number of digits of the numbers that are written into a law.
const DIGITS: usize = 4;

/// A number rounded to the digits of a law.
pub(super) fn rounded(value: f64) -> f64 {
    format!("{value:.*e}", DIGITS - 1).parse().unwrap_or(value)
}

/// A number with its unit as an expression.
pub(super) fn quantity(value: f64, unit: &Unit) -> String {
    if matches!(unit.as_str(), "" | "1") {
        format!("{value:?}")
    } else {
        format!("{value:?} {{{unit}}}")
    }
}

/// A number with its unit as a reader would write it.
pub(super) fn words(value: f64, unit: &Unit) -> String {
    let value = rounded(value);
    if matches!(unit.as_str(), "" | "1") { format!("{value}") } else { format!("{value} {unit}") }
}
