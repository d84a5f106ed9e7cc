//! Checks of options, and of what a method needs.

use lacuna::plugin::reliability::LimitState;
use lacuna::run::Stop;
use lacuna::text::Complaints;

/// Reports a number below the least one.
pub fn at_least(key: &str, value: usize, least: usize, complaints: &mut Complaints<'_>) {
    if value < least {
        let problem = complaints.at(key).say("the number is too small");
        problem.expected(format!("at least {least}")).found(value);
    }
}

/// Reports a number that is not above zero.
pub fn positive(key: &str, value: f64, complaints: &mut Complaints<'_>) {
    if !(value > 0.0 && value.is_finite()) {
        complaints
            .at(key)
            .say("the number is out of range")
            .expected("a number above 0")
            .found(value);
    }
}

/// Reports a number outside an open interval.
pub fn between(key: &str, value: f64, (low, high): (f64, f64), complaints: &mut Complaints<'_>) {
    if !(value > low && value < high) {
        let problem = complaints.at(key).say("the number is out of range");
        problem.expected(format!("a number between {low} and {high}")).found(value);
    }
}

/// The error of a method that needs standard normal variables, if these are not.
pub fn standard_normal(method: &str, state: &dyn LimitState) -> Result<(), Stop> {
    if state.is_standard_normal() {
        return Ok(());
    }
    let message =
        format!("`{method}` needs independent variables of known distributions, not a posterior");
    Err(Stop::new(message)
        .help("`subset_simulation`, `active_kriging` and `monte_carlo` work from a posterior"))
}
