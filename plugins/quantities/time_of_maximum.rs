//! `time_of_maximum`: where a curve is largest.

use lacuna::plugin::quantity::{Arguments, Functional, Misfit, functional};
use lacuna::plugin::{Component, Quantity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::largest;

/// Time of the maximum: the point of the axis at which a curve is largest, the first of equal ones.
///
/// It is a point of the grid. Where two peaks are of similar height the distribution has two modes, of which mean and
/// standard deviation tell nothing: look at the quantiles.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TimeOfMaximum {
    /// `true` takes the largest magnitude, of either sign.
    pub absolute: bool,
}

impl Component for TimeOfMaximum {}

impl Quantity for TimeOfMaximum {
    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        let curve = arguments.curve()?;
        let (grid, absolute) = (curve.grid.to_vec(), self.absolute);
        Ok(functional(curve.grid_unit.clone(), move |values| {
            let sizes = values.iter().map(|y| if absolute { y.abs() } else { *y });
            largest(sizes).map_or(f64::NAN, |i| grid[i])
        }))
    }
}

lacuna::register!(Quantity, "time_of_maximum", TimeOfMaximum);

#[cfg(test)]
mod tests {
    use super::super::common::testing::value;

    #[test]
    fn it_is_the_first_point_of_the_largest_value() {
        let (grid, values) = ([0.0, 1.0, 2.0, 5.0], [1.0, 3.0, -7.0, 3.0]);
        assert_eq!(value("time_of_maximum", "", &grid, &values), (1.0, "s".to_owned()));
        assert_eq!(value("time_of_maximum", "absolute = true", &grid, &values).0, 2.0);
    }
}
