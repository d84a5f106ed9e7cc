//! `integral`: the integral along the axis.

use lacuna::plugin::quantity::{Arguments, Functional, Misfit, functional};
use lacuna::plugin::{Component, Quantity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::trapezoid;

/// Integral of a curve along the axis, by the trapezoidal rule on the points of the curve. The points may be uneven.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Integral {}

impl Component for Integral {}

impl Quantity for Integral {
    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        let curve = arguments.curve()?;
        let grid = curve.grid.to_vec();
        let Some(unit) = curve.unit.times(curve.grid_unit) else {
            let message = "units with a zero point of their own cannot be multiplied";
            let found = format!("`{}` times `{}`", curve.unit, curve.grid_unit);
            return Err(vec![Misfit::new("use", message).found(found)]);
        };
        Ok(functional(unit, move |values| trapezoid_of(&grid, values)))
    }
}

/// Returns the integral; NaN if a value is, also on a single point.
fn trapezoid_of(grid: &[f64], values: &[f64]) -> f64 {
    if values.iter().any(|y| y.is_nan()) { f64::NAN } else { trapezoid(grid, |i| values[i]) }
}

lacuna::register!(Quantity, "integral", Integral);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{value, value_in};

    #[test]
    fn that_of_a_line_on_uneven_points_is_exact() {
        let grid = [0.0, 0.1, 0.7, 2.0];
        let values = grid.map(|t| 3.0 - 2.0 * t);
        let (found, unit) = value("integral", "", &grid, &values);
        assert!((found - 2.0).abs() < 1e-15 && unit == "s");
        let of_force = value_in("integral", "", ["N", "s"], &[0.0, 2.0], &[1.0, 3.0]);
        assert_eq!(of_force.map(|(found, _)| found), Ok(4.0));
    }

    #[test]
    fn a_temperature_in_degrees_celsius_has_none() {
        assert!(value_in("integral", "", ["degC", "s"], &[0.0, 1.0], &[0.0, 1.0]).is_err());
    }
}
