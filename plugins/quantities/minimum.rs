//! `minimum`: the smallest value of a curve.

use lacuna::plugin::quantity::{Arguments, Functional, Misfit, functional};
use lacuna::plugin::{Component, Quantity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::maximum;

/// Minimum: the smallest value of a curve, at its points. What `maximum` says of noise holds for it too.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Minimum {}

impl Component for Minimum {}

impl Quantity for Minimum {
    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        let unit = arguments.curve()?.unit.clone();
        Ok(functional(unit, |values| -maximum(values.iter().map(|y| -y))))
    }
}

lacuna::register!(Quantity, "minimum", Minimum);

#[cfg(test)]
mod tests {
    use super::super::common::testing::value;

    #[test]
    fn it_is_the_smallest_value() {
        assert_eq!(value("minimum", "", &[0.0, 1.0, 4.0], &[1.0, -7.0, 3.0]).0, -7.0);
        assert!(value("minimum", "", &[0.0, 1.0], &[1.0, f64::NAN]).0.is_nan());
    }
}
