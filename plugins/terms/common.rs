//! What terms share.

use lacuna::data::Unit;
use lacuna::plugin::term::Place;

/// What a term is a function of: the state itself where nothing else is given.
pub fn of<'a>(given: Option<&'a str>, place: &Place<'a>) -> &'a str {
    given.unwrap_or(&place.state.name)
}

/// A number with its unit, as an expression.
pub fn quantity(value: f64, unit: &Unit) -> String {
    if unit.as_str().is_empty() { format!("{value:?}") } else { format!("{value:?} {{{unit}}}") }
}
