//! `range`: peak to peak.

use lacuna::plugin::quantity::{Arguments, Functional, Misfit, functional};
use lacuna::plugin::{Component, Quantity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::maximum;

/// Range: largest less smallest value of a curve (peak to peak), at its points.
///
/// What `maximum` says of noise holds for it twice. The range that governs fatigue is that of the largest cycle, which is
/// the same for a whole record: `rainflow` counts the others as well.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Range {}

impl Component for Range {}

impl Quantity for Range {
    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        let unit = arguments.curve()?.unit.difference();
        let highest = |values: &[f64]| maximum(values.iter().copied());
        Ok(functional(unit, move |values| highest(values) + maximum(values.iter().map(|y| -y))))
    }
}

lacuna::register!(Quantity, "range", Range);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{value, value_in};

    #[test]
    fn it_is_the_distance_from_peak_to_peak() {
        assert_eq!(value("range", "", &[0.0, 1.0, 4.0], &[1.0, -7.0, 3.0]).0, 10.0);
        let of_temperatures = value_in("range", "", ["degC", "s"], &[0.0, 1.0], &[20.0, 35.0]);
        assert_eq!(of_temperatures, Ok((15.0, "K".to_owned())));
    }
}
