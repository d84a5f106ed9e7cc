//! What terms share.

use lacuna::data::Unit;
use lacuna::plugin::term::Place;
use toml::Table;

/// What a term is a function of: the state itself where nothing else is given.
pub fn of<'a>(given: Option<&'a str>, place: &Place<'a>) -> &'a str {
    given.unwrap_or(&place.state.name)
}

/// Options of a term that is a function of each of these.
pub fn of_each(states: &[String]) -> impl Iterator<Item = Table> {
    states.iter().map(|state| Table::from_iter([("of".to_owned(), state.as_str().into())]))
}

/// A number with its unit, as an expression.
pub fn quantity(value: f64, unit: &Unit) -> String {
    if unit.as_str().is_empty() { format!("{value:?}") } else { format!("{value:?} {{{unit}}}") }
}
