//! `misplacement`: a sensor that is not where it should be.

use std::collections::BTreeMap;

use lacuna::data::{Layout, Unit};
use lacuna::linalg::Matrix;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::{Description, Reach, Situation};
use lacuna::plugin::{Component, Context, Effect, Hyperparameter};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{Along, Line, Measure, Stations, Unknown, check, lagrange, parameters, signs};

/// Misplacement: a sensor stands beside the place that the model assumes.
///
/// ```text
/// y(x) → y(x + distance)
/// ```
///
/// What the response is beside the place is read from its neighbours on a line: from the parabola through the place
/// and the two next to it, or at an end of the line through the last three (a straight line where there are two
/// places only). That is good for distances well below those between the places, and for a response that is smooth
/// along the line.
///
/// It is easily confused with `gain` where the response falls off evenly along the line, with `gauge_length`, and
/// with `delay` where waves run along it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Misplacement {
    /// Prior of the distance, in the unit of `positions`, positive towards larger coordinates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance: Option<Distribution>,
    /// The axis along which the response changes: one of labels, whose `positions` are given, or of numbers.
    pub axis: String,
    /// Where the labels of the axis stand on a line, such as `{ A = 0.10, B = 0.15 }`; what is not on the line is
    /// left out, and stays as it is.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub positions: BTreeMap<String, f64>,
    /// The unit of `positions`; that of an axis of numbers is its own.
    pub unit: Unit,
}

impl Default for Misplacement {
    fn default() -> Self {
        let unit = Unit::parse("m").unwrap_or_default();
        Self { distance: None, axis: "sensor".to_owned(), positions: BTreeMap::new(), unit }
    }
}

impl Misplacement {
    fn unknowns(&self, layout: &Layout) -> [Unknown<'_>; 1] {
        [Unknown {
            name: "distance",
            symbol: "d",
            measure: Measure::In(self.line().unit(layout)),
            prior: self.distance.as_ref(),
            limits: (f64::NEG_INFINITY, f64::INFINITY),
            example: "{ normal = [0, 0.005] }",
        }]
    }

    fn line(&self) -> Line<'_> {
        Line { axis: &self.axis, positions: &self.positions, unit: &self.unit }
    }
}

/// The weights of places nearby, at `nodes`, in what a place at `x` shows.
fn weights(nodes: &[f64], x: f64, value: f64) -> [f64; 3] {
    lagrange(nodes, x + value)[0]
}

/// Their derivatives by the unknown.
fn slopes(nodes: &[f64], x: f64, value: f64) -> [f64; 3] {
    lagrange(nodes, x + value)[1]
}

impl Component for Misplacement {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if let Some(along) = Along::check(context.layout, &self.axis, complaints) {
            Stations::check(&along, &self.positions, 2, complaints);
        }
        check(&self.unknowns(context.layout), context.layout, complaints);
    }
}

impl Effect for Misplacement {
    fn describe(&self) -> Description {
        Description {
            title: "misplacement: a sensor that is not where it should be".into(),
            formula: "y(x + distance)".into(),
            source: "standard: interpolation in space (Lagrange)".into(),
        }
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        parameters(&self.unknowns(layout), layout)
    }

    fn absent(&self, _: &Layout) -> Vec<f64> {
        vec![0.0]
    }

    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        self.line().combined(layout, response, |nodes, x| weights(nodes, x, values[0]))
    }

    fn by_parameters(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        self.line().combined_slopes(layout, response, |nodes, x| slopes(nodes, x, values[0]))
    }

    fn push_forward(
        &self,
        layout: &Layout,
        _: &[f64],
        values: &[f64],
        tangent: &[f64],
    ) -> Vec<f64> {
        self.apply(layout, tangent, values)
    }

    fn starts(&self, _: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        signs(self.distance.as_ref(), 0.0).into_iter().map(|x| vec![x]).collect()
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let prior = |spacing: f64| Distribution::Normal([0.0, 0.2 * spacing]);
        self.line().proposals(situation, 2, "distance", prior)
    }

    fn reach(&self) -> Reach {
        Reach::Single
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
