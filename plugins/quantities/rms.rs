//! `rms`: root mean square.

use lacuna::plugin::quantity::{Arguments, Functional, Misfit, functional};
use lacuna::plugin::{Component, Quantity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::average;

/// Root mean square of a curve over the axis.
///
/// ```text
/// rms² = ∫ (y - m)² dt / (last - first)
/// ```
///
/// by the trapezoidal rule on the points of the curve, with `m = 0`, or the mean of the curve if `about_mean` is `true`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Rms {
    /// `true` takes the mean of the curve off first: the standard deviation along the axis.
    pub about_mean: bool,
}

impl Component for Rms {}

impl Quantity for Rms {
    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        let curve = arguments.curve()?;
        let (grid, about_mean) = (curve.grid.to_vec(), self.about_mean);
        let unit = if about_mean { curve.unit.difference() } else { curve.unit.clone() };
        Ok(functional(unit, move |values| {
            let mean = if about_mean { average(&grid, |i| values[i]) } else { 0.0 };
            average(&grid, |i| (values[i] - mean).powi(2)).sqrt()
        }))
    }
}

lacuna::register!(Quantity, "rms", Rms);

#[cfg(test)]
mod tests {
    use super::super::common::testing::value;

    /// A sine over whole periods on an even grid: the trapezoidal rule is exact for its square.
    #[test]
    fn it_is_that_of_a_sine() {
        let grid: Vec<f64> = (0..=48).map(|i| f64::from(i) / 48.0).collect();
        let values: Vec<f64> =
            grid.iter().map(|t| 5.0 + 3.0 * (std::f64::consts::TAU * 2.0 * t).sin()).collect();
        let whole = value("rms", "", &grid, &values).0;
        assert!((whole - (25.0_f64 + 4.5).sqrt()).abs() < 1e-13);
        let moving = value("rms", "about_mean = true", &grid, &values).0;
        assert!((moving - 3.0 / 2.0_f64.sqrt()).abs() < 1e-13);
    }
}
