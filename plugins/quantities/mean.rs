//! `mean`: the mean along the axis.

use lacuna::plugin::quantity::{Arguments, Functional, Misfit, functional};
use lacuna::plugin::{Component, Quantity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::average;

/// Mean of a curve over the axis: its integral divided by the length, by the trapezoidal rule, so that on uneven points
/// every value counts by the length that it stands for.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Mean {}

impl Component for Mean {}

impl Quantity for Mean {
    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        let curve = arguments.curve()?;
        let grid = curve.grid.to_vec();
        Ok(functional(curve.unit.clone(), move |values| average(&grid, |i| values[i])))
    }
}

lacuna::register!(Quantity, "mean", Mean);

#[cfg(test)]
mod tests {
    use super::super::common::testing::value;

    #[test]
    fn a_line_on_uneven_points_has_the_mean_of_its_ends() {
        let grid = [0.0, 0.1, 0.7, 2.0];
        let values = grid.map(|t| 3.0 - 2.0 * t);
        assert!((value("mean", "", &grid, &values).0 - 1.0).abs() < 1e-15);
        assert_eq!(value("mean", "", &[4.0], &[7.0]).0, 7.0);
    }
}
