//! Functions shared by the terms.

use lacuna::data::Unit;
use lacuna::plugin::term::Place;
use toml::Table;

/// Returns the argument `u` of a term: the state itself unless an expression is given.
pub fn of<'a>(given: Option<&'a str>, place: &Place<'a>) -> &'a str {
    given.unwrap_or(&place.state.name)
}

/// Returns, for each of these states, the options of a term that takes it as argument.
pub fn of_each(states: &[String]) -> impl Iterator<Item = Table> {
    states.iter().map(|state| Table::from_iter([("of".to_owned(), state.as_str().into())]))
}

/// Formats a number with its unit as an expression.
pub fn quantity(value: f64, unit: &Unit) -> String {
    if unit.as_str().is_empty() { format!("{value:?}") } else { format!("{value:?} {{{unit}}}") }
}

/// Formats a deflection `u` about an equilibrium.
pub fn deflection(u: &str, about: Option<&str>) -> String {
    about.map_or_else(|| u.to_owned(), |about| format!("{u} - ({about})"))
}
