//! `maximum`: the largest value of a curve.

use lacuna::plugin::quantity::{Arguments, Functional, Misfit, functional};
use lacuna::plugin::{Component, Quantity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::maximum;

/// Maximum: the largest value of a curve.
///
/// It is taken at the points of the curve: a peak between two points is missed by up to `(ω Δ)² / 8` of its height, for
/// an angular frequency `ω` and points `Δ` apart.
///
/// The noise of a measuring chain raises the maximum of a record, since the largest of many noisy values is one that noise
/// has raised. The maximum of the true response leaves the scatter between replicates out, as `include` does by default.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Maximum {
    /// `true` takes the largest magnitude, of either sign.
    pub absolute: bool,
}

impl Component for Maximum {}

impl Quantity for Maximum {
    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        let absolute = self.absolute;
        let size = move |y: &f64| if absolute { y.abs() } else { *y };
        let unit = arguments.curve()?.unit.clone();
        Ok(functional(unit, move |values| maximum(values.iter().map(size))))
    }
}

lacuna::register!(Quantity, "maximum", Maximum);

#[cfg(test)]
mod tests {
    use super::super::common::testing::value;

    #[test]
    fn it_is_the_largest_value_or_magnitude() {
        let (grid, values) = ([0.0, 1.0, 2.0, 5.0], [1.0, -7.0, 3.0, 2.0]);
        assert_eq!(value("maximum", "", &grid, &values), (3.0, "1".to_owned()));
        assert_eq!(value("maximum", "absolute = true", &grid, &values).0, 7.0);
        assert!(value("maximum", "", &grid, &[1.0, f64::NAN, 3.0, 2.0]).0.is_nan());
    }
}
