//! Functions shared by the terms.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::amend::State;
use lacuna::plugin::term::{Index, Place, Site, Summand};
use toml::Table;

/// Returns the argument `u` of a term: the state itself unless an expression is given.
pub fn of<'a>(given: Option<&'a str>, place: &Place<'a>) -> &'a str {
    given.unwrap_or(&place.state.name)
}

/// Returns, for each of these states, the options of a term that takes it as argument.
pub fn of_each(states: &[&State]) -> impl Iterator<Item = Table> {
    states.iter().map(|state| Table::from_iter([("of".to_owned(), state.name.as_str().into())]))
}

/// Returns the options of a term that takes an expression as argument and needs its unit.
pub fn of_quantity(of: &str, unit: &Unit) -> Table {
    let pair = |key: &str, value: &str| (key.to_owned(), value.into());
    Table::from_iter([pair("of", of), pair("unit", unit.as_str())])
}

/// Returns, for each of these states, the options of a term that takes it as argument and needs its unit.
pub fn of_quantities(states: &[&State]) -> impl Iterator<Item = Table> {
    states.iter().map(|state| of_quantity(&state.name, &state.unit))
}

/// Returns, for each part of the rate that changes with the time alone, the options of a term that takes it as argument.
pub fn of_inputs(site: &Site<'_>) -> impl Iterator<Item = Table> {
    site.state.inputs.iter().map(|(input, unit)| of_quantity(input, unit))
}

/// Returns the options of a loss to surroundings, one for each quantity from which the rate subtracts the temperature;
/// none if the state is no temperature.
pub fn ambient_each(site: &Site<'_>) -> Vec<Table> {
    let is_temperature =
        Unit::parse("K").is_ok_and(|kelvin| kelvin.same_dimension(&site.state.unit));
    let options = |at: &str| Table::from_iter([("ambient".to_owned(), at.into())]);
    if is_temperature { site.references().map(options).collect() } else { Vec::new() }
}

/// Returns `abs(u / scale)^power` as an expression with a smooth bend at zero, whose slope is finite for any power
/// above zero if multiplied by `u`.
pub fn magnitude(u: &str, scale: &str, power: &str) -> String {
    format!("((({u}) / ({scale}))^2 + 1e-6)^(0.5 * ({power}))")
}

/// Returns the law `-u (abs(u) / scale)^(power - 1)` of an argument `of` in `unit`, with the size of `u` along the run as scale and a
/// power that is unknown: uniform between `bounds` unless a prior is given.
///
/// # Errors
/// If the unit or the size of the argument is not known.
pub fn power_law(
    place: &Place<'_>,
    (argument, unit): (Option<&str>, Option<&Unit>),
    power: Option<&Distribution>,
    bounds: [f64; 2],
) -> Result<Summand, String> {
    let u = of(argument, place);
    let name = format!("{}_power", place.name);
    let prior = power.cloned().unwrap_or(Distribution::Uniform(bounds));
    let starts = [0.15, 0.5, 0.85].map(|p| prior.quantile(p)).to_vec();
    let scale = scale(place, u, unit_of(unit, argument, place)?)?;
    Ok(Summand {
        shape: format!("-({u}) * {}", magnitude(u, &scale, &format!("{name} - 1"))),
        indices: vec![Index { name, unit: Unit::dimensionless(), prior, starts }],
        scale: Some(format!("({u})")),
        fixed: Some(format!("scale = {scale}")),
        ..Summand::default()
    })
}

/// Returns the quantity limited to `limit` on both sides, with bends of a small width.
pub fn clamped(u: &str, limit: &str, width: &str) -> String {
    let side = |sign: &str| format!("sqrt((({u}) {sign} ({limit}))^2 + ({width})^2)");
    format!("0.5 * ({} - {})", side("+"), side("-"))
}

/// Returns the size of a quantity along the run.
///
/// # Errors
/// If it is zero or cannot be computed.
pub fn size(place: &Place<'_>, u: &str) -> Result<f64, String> {
    let size = (place.size)(u)?;
    if size.is_finite() && size > 0.0 {
        return Ok(size);
    }
    Err(format!("the quantity `{u}` is {size} along the run at the middle of the priors"))
}

/// Returns the size of a quantity along the run, with its unit.
///
/// # Errors
/// If it is zero or cannot be computed.
pub fn scale(place: &Place<'_>, u: &str, unit: &Unit) -> Result<String, String> {
    Ok(quantity(size(place, u)?, unit))
}

/// Returns the given prior, or a uniform one between two multiples of the size of a quantity along the run.
///
/// # Errors
/// If none is given and the size is zero or cannot be computed.
pub fn share(
    given: Option<&Distribution>,
    place: &Place<'_>,
    u: &str,
    bounds: [f64; 2],
) -> Result<Distribution, String> {
    let size = size(place, u)?;
    Ok(given.cloned().unwrap_or_else(|| Distribution::Uniform(bounds.map(|share| share * size))))
}

/// Returns the given prior, or a log-uniform one between two multiples of the size of a quantity along the run.
///
/// # Errors
/// If none is given and the size is zero or cannot be computed.
pub fn range(
    given: Option<&Distribution>,
    place: &Place<'_>,
    u: &str,
    bounds: [f64; 2],
) -> Result<Distribution, String> {
    Ok(between(given, size(place, u)?, bounds))
}

fn between(given: Option<&Distribution>, size: f64, bounds: [f64; 2]) -> Distribution {
    given.cloned().unwrap_or_else(|| Distribution::LogUniform(bounds.map(|share| share * size)))
}

/// Returns the size of the deflection of which `u` is the speed, from the speed and the rate of the state: that of a
/// harmonic motion.
///
/// # Errors
/// If one of them is zero or cannot be computed.
fn travel(place: &Place<'_>, u: &str) -> Result<f64, String> {
    Ok(size(place, u)?.powi(2) / size(place, &place.state.rate)?)
}

/// Returns the size of the deflection of which `u` is the speed, with its unit.
///
/// # Errors
/// If it cannot be estimated.
pub fn deflection_of(place: &Place<'_>, u: &str, unit: &Unit) -> Result<String, String> {
    Ok(quantity(travel(place, u)?, unit))
}

/// Returns the unit of the deflection of which a quantity in `unit` is the speed.
///
/// # Errors
/// If the model has no time, or the product has no unit.
pub fn deflection_unit(place: &Place<'_>, unit: &Unit) -> Result<Unit, String> {
    let time = place.time.ok_or("the model has no time")?;
    Ok(unit.times(time.unit).ok_or("the deflection has no unit")?.plain())
}

/// Returns an unknown deflection of which `u`, in `unit`, is the speed: log-uniform between two multiples of its size
/// unless a prior is given.
///
/// # Errors
/// If its size cannot be estimated.
pub fn deflection_index(
    given: Option<&Distribution>,
    place: &Place<'_>,
    u: &str,
    unit: &Unit,
    bounds: [f64; 2],
) -> Result<Index, String> {
    let size = travel(place, u)?;
    let prior = between(given, size, bounds);
    let starts = [0.15, 0.4, 0.65, 0.9].map(|p| prior.quantile(p)).to_vec();
    let unit = deflection_unit(place, unit)?;
    Ok(Index { name: format!("{}_deflection", place.name), unit, prior, starts })
}

/// The width over which the sign of a dry friction is smoothed, relative to the change of the speed within one step of the
/// response: so narrow that the response does not show it. One step is not: the friction is then overestimated by a third
/// where the speed often reverses.
const NARROW: f64 = 0.05;

/// Returns the speed over which the sign of a dry friction is smoothed, and the words that say so if the term chose it.
///
/// # Errors
/// If it is not given and the argument is not the state, or the state does not change.
pub fn width(
    given: Option<&str>,
    of: Option<&str>,
    place: &Place<'_>,
) -> Result<(String, Option<String>), String> {
    match (given, of, place.time) {
        (Some(width), ..) => Ok((width.to_owned(), None)),
        (None, None, Some(time)) => {
            let width = NARROW * (place.size)(&place.state.rate)? * time.step;
            if !(width.is_finite() && width > 0.0) {
                return Err("the speed does not change: give `width`".into());
            }
            let width = quantity(width, &place.state.unit);
            let fixed =
                format!("width = {width}, a twentieth of the change of the speed within one step");
            Ok((width, Some(fixed)))
        }
        _ => Err("the unit of the speed is not known: give `width`".into()),
    }
}

/// Returns the temperature of the surroundings: the given one, or the only quantity that the rate subtracts from the
/// state.
///
/// # Errors
/// If none is given and the rate subtracts none or several.
pub fn ambient(given: Option<&str>, place: &Place<'_>) -> Result<String, String> {
    let state = place.state;
    let own = state.references.iter().filter(|[name, _]| *name == state.name);
    let found: Vec<&String> = own.map(|[_, at]| at).collect();
    match (given, &found[..]) {
        (Some(given), _) => Ok(given.to_owned()),
        (None, [one]) => Ok((*one).clone()),
        (None, _) => Err("the temperature of the surroundings is not known: give `ambient`".into()),
    }
}

/// Returns the unit of the argument `u` of a term.
///
/// # Errors
/// If it is another quantity than the state and no unit is given.
pub fn unit_of<'a>(
    given: Option<&'a Unit>,
    of: Option<&str>,
    place: &Place<'a>,
) -> Result<&'a Unit, String> {
    match (given, of) {
        (Some(unit), _) => Ok(unit),
        (None, None) => Ok(&place.state.unit),
        (None, Some(_)) => Err("the unit of `of` is not known: give `unit`".into()),
    }
}

/// Formats a number with its unit as an expression.
pub fn quantity(value: f64, unit: &Unit) -> String {
    if unit.as_str().is_empty() { format!("{value:?}") } else { format!("{value:?} {{{unit}}}") }
}

/// Formats a deflection `u` about an equilibrium.
pub fn deflection(u: &str, about: Option<&str>) -> String {
    about.map_or_else(|| u.to_owned(), |about| format!("{u} - ({about})"))
}
