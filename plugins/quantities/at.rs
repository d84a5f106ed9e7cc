//! `at`: the value at a place.

use lacuna::plugin::quantity::{Arguments, Functional, Misfit, functional};
use lacuna::plugin::{Component, Quantity};
use lacuna::text::quantity;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Value at a place: that of a curve at a point of its axis, linear between the points at which the curve has values.
///
/// ```toml
/// [[quantity]]
/// name = "late"
/// use = "at"
/// place = { value = 0.8, unit = "ms" }
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct At {
    /// Place on the axis: a number in the unit of the axis, or with a unit of its own as in
    /// `{ value = 0.8, unit = "ms" }`.
    pub place: quantity::Quantity,
}

impl Component for At {}

impl Quantity for At {
    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        let curve = arguments.curve()?;
        let place = curve.point("place", &self.place)?;
        let (first, last) = (curve.grid[0], curve.grid[curve.grid.len() - 1]);
        if !(first..=last).contains(&place) {
            let message = format!("the curve has no value at this {}", curve.axis);
            let expected = format!("a place from {first} to {last} {}", curve.grid_unit);
            return Err(vec![Misfit::new("place", message).expected(expected).found(place)]);
        }
        let after = curve.grid.partition_point(|t| *t < place);
        let before = after.saturating_sub(1);
        let share = if after == before {
            0.0
        } else {
            (place - curve.grid[before]) / (curve.grid[after] - curve.grid[before])
        };
        // A value of no weight must not enter: it may not be a number.
        Ok(functional(curve.unit.clone(), move |values| match share {
            0.0 => values[before],
            1.0 => values[after],
            _ => values[before] + share * (values[after] - values[before]),
        }))
    }
}

lacuna::register!(Quantity, "at", At);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{value, value_in};

    #[test]
    fn it_is_linear_between_points_and_that_of_a_point_on_it() {
        let (grid, values) = ([0.0, 1.0, 3.0], [5.0, 1.0, 2.0]);
        for (place, expected) in [("0", 5.0), ("1", 1.0), ("3", 2.0), ("2", 1.5), ("0.25", 4.0)] {
            assert_eq!(value("at", &format!("place = {place}"), &grid, &values).0, expected);
        }
        let in_milliseconds = "place = { value = 2000, unit = \"ms\" }";
        assert_eq!(value("at", in_milliseconds, &grid, &values).0, 1.5);
    }

    #[test]
    fn a_place_outside_the_curve_is_refused() {
        for place in ["-1", "3.5", "{ value = 1, unit = \"m\" }"] {
            let options = format!("place = {place}");
            let found = value_in("at", &options, ["1", "s"], &[0.0, 1.0, 3.0], &[0.0; 3]);
            assert_eq!(found.map_err(|misfits| misfits[0].key.clone()), Err("place".to_owned()));
        }
    }
}
