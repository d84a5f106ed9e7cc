//! `misplacement`: a sensor at a wrong position.

use std::collections::BTreeMap;

use lacuna::data::{Layout, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::effect::{CurveEffect, Description, Form, Measure, Reach, Situation, Unknown};
use lacuna::plugin::{Context, Effect};
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{Along, Line, Stations, lagrange};

/// Misplacement: a sensor is not at the position that the model assumes.
///
/// ```text
/// y(x) → y(x + distance)
/// ```
///
/// The response next to the position is interpolated from its neighbours on a line: by the parabola through the place
/// and its two neighbours, or at an end of the line through the last three (by a straight line if there are only two
/// places). This is accurate for distances well below the spacing of the places and for a response that varies smoothly
/// along the line.
///
/// It is easily confused with `gain` if the response decreases evenly along the line, with `gauge_length`, and with
/// `delay` if waves travel along the line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Misplacement {
    /// Prior of the displacement, in the unit of `positions`, positive towards larger coordinates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance: Option<Distribution>,
    /// Name of the axis along which the response varies: an axis of labels, whose `positions` must be given, or an axis
    /// of numbers.
    pub axis: String,
    /// Coordinates of the axis labels on a line, such as `{ A = 0.10, B = 0.15 }`, in `unit`. Labels that are not
    /// listed are not on the line and remain unchanged.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub positions: BTreeMap<String, f64>,
    /// Unit of `positions`; an axis of numbers has its own unit.
    pub unit: Unit,
}

impl Default for Misplacement {
    fn default() -> Self {
        let unit = Unit::parse("m").unwrap_or_default();
        Self { distance: None, axis: "sensor".to_owned(), positions: BTreeMap::new(), unit }
    }
}

impl Misplacement {
    fn line(&self) -> Line<'_> {
        Line { axis: &self.axis, positions: &self.positions, unit: &self.unit }
    }
}

/// Weights of the neighbouring places at `nodes` in the value that a sensor at `x`, displaced by `value`, shows.
fn weights(nodes: &[f64], x: f64, value: f64) -> [f64; 3] {
    lagrange(nodes, x + value)[0]
}

/// Derivatives of [`weights`] with respect to the displacement.
fn slopes(nodes: &[f64], x: f64, value: f64) -> [f64; 3] {
    lagrange(nodes, x + value)[1]
}

impl CurveEffect for Misplacement {
    const FORM: Form = Form::Linear;

    fn describe(&self) -> Description {
        Description::new(
            "misplacement: a sensor that is not where it should be",
            "y(x + distance)",
            "standard: interpolation in space (Lagrange)",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![Unknown::new(
            "distance",
            "d",
            Measure::Along(self.axis.clone(), self.unit.clone()),
            &self.distance,
            "{ normal = [0, 0.005] }",
        )]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        self.line().combined(layout, response, |nodes, x| weights(nodes, x, values[0]))
    }

    fn slopes(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        self.line().combined_slopes(layout, response, |nodes, x| slopes(nodes, x, values[0]))
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let prior = |spacing: f64| Distribution::Normal([0.0, 0.2 * spacing]);
        self.line().proposals(situation, 2, "distance", prior)
    }

    fn reach(&self) -> Reach {
        Reach::Single
    }

    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if let Some(along) = Along::check(context.layout, &self.axis, complaints) {
            Stations::check(&along, &self.positions, 2, complaints);
        }
    }
}

lacuna::register!(Effect, "misplacement", Misplacement);

#[cfg(test)]
mod tests {
    use super::super::common::testing::effect;

    use lacuna::data::{Axis, Layout, Unit};

    /// One number for each of four places.
    fn layout() -> Layout {
        let axes = vec![Axis::labels("sensor", ["A", "B", "C", "D"])];
        Layout { name: "y".into(), unit: Unit::dimensionless(), axes }
    }

    /// A parabola through three of its points is itself; `D` is not on the line.
    #[test]
    fn a_parabola_is_read_beside_the_place() {
        let options = "distance = { normal = [0, 1] }\npositions = { B = 0.0, A = 1.0, C = 4.0 }";
        let parabola = |x: f64| 2.0 - x + 0.5 * x * x;
        let response = [parabola(1.0), parabola(0.0), parabola(4.0), 7.0];
        let found = effect("misplacement", options).apply(&layout(), &response, &[0.3]);
        let exact = [parabola(1.3), parabola(0.3), parabola(4.3), 7.0];
        assert!(found.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-14), "{found:?}");
    }

    #[test]
    fn two_places_make_a_straight_line() {
        let options = "distance = { normal = [0, 1] }\npositions = { B = 0.0, A = 2.0 }";
        let response = [5.0, 1.0, 0.0, 0.0];
        let found = effect("misplacement", options).apply(&layout(), &response, &[-0.5]);
        assert_eq!(found, [4.0, 0.0, 0.0, 0.0]);
    }
}
