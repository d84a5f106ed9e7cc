//! `exceedance`: how long a curve is above a threshold.

use lacuna::data::Unit;
use lacuna::plugin::quantity::{Arguments, Functional, Misfit, functional};
use lacuna::plugin::{Component, Quantity};
use lacuna::text::quantity;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Exceedance: the time for which a curve is above a threshold, or its share of the record.
///
/// The curve is linear between its points, so that the time does not jump from point to point. For the probability that a
/// limit is exceeded at all, compare the quantiles of `maximum` with the limit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Exceedance {
    /// Threshold: a number in the unit of the response, or with a unit of its own.
    pub threshold: quantity::Quantity,
    /// Number that is reported.
    #[serde(default)]
    pub output: Output,
    /// `true` compares the magnitude with the threshold, of either sign.
    #[serde(default)]
    pub absolute: bool,
}

/// Number that is reported of an exceedance.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Output {
    /// Length along the axis above the threshold, in the unit of the axis.
    #[default]
    Time,
    /// Share of the record above the threshold, from 0 to 1.
    Share,
}

impl Component for Exceedance {}

impl Quantity for Exceedance {
    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        let curve = arguments.curve()?;
        let threshold = curve.level("threshold", &self.threshold)?;
        let grid = curve.grid.to_vec();
        let length = grid[grid.len() - 1] - grid[0];
        let both = self.absolute;
        let (unit, scale) = match self.output {
            Output::Time => (curve.grid_unit.difference(), 1.0),
            Output::Share => (Unit::dimensionless(), length.recip()),
        };
        if self.output == Output::Share && grid.len() < 2 {
            let message = "a curve of one point has no length of which there is a share";
            return Err(vec![Misfit::new("output", message).expected("`output = \"time\"`")]);
        }
        Ok(functional(unit, move |values| {
            let sides = if both { &[1.0, -1.0][..] } else { &[1.0] };
            let of = |side: &f64| above(&grid, |i| side * values[i], threshold);
            if values.iter().any(|y| y.is_nan()) {
                return f64::NAN;
            }
            // Below a negative threshold of the magnitude there is nothing.
            if both && threshold < 0.0 {
                return length * scale;
            }
            sides.iter().map(of).sum::<f64>() * scale
        }))
    }
}

/// Returns the length along the grid for which a piecewise linear curve is above a threshold.
fn above(grid: &[f64], value: impl Fn(usize) -> f64, threshold: f64) -> f64 {
    let interval = |i: usize| {
        let (a, b) = (value(i) - threshold, value(i + 1) - threshold);
        let share = match (a > 0.0, b > 0.0) {
            (true, true) => 1.0,
            (false, false) => 0.0,
            (true, false) => a / (a - b),
            (false, true) => b / (b - a),
        };
        share * (grid[i + 1] - grid[i])
    };
    (0..grid.len().saturating_sub(1)).map(interval).sum()
}

lacuna::register!(Quantity, "exceedance", Exceedance);

#[cfg(test)]
mod tests {
    use super::super::common::testing::value;

    /// A triangle of height 2 on a base of 4 is above 1 for half of it.
    #[test]
    fn a_triangle_is_above_half_its_height_for_half_its_base() {
        let (grid, values) = ([0.0, 2.0, 4.0, 10.0], [0.0, 2.0, 0.0, 0.0]);
        assert_eq!(value("exceedance", "threshold = 1", &grid, &values), (2.0, "s".to_owned()));
        let share = "threshold = 1\noutput = \"share\"";
        assert_eq!(value("exceedance", share, &grid, &values), (0.2, "1".to_owned()));
        let mirrored = values.map(|y| -y);
        assert_eq!(value("exceedance", "threshold = 1", &grid, &mirrored).0, 0.0);
        let both = "threshold = 1\nabsolute = true";
        assert_eq!(value("exceedance", both, &grid, &mirrored).0, 2.0);
    }
}
