//! `gauge_length`: a sensor that is long.

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

/// Gauge length: a sensor shows the mean over its length, and the model a point.
///
/// ```text
/// y(x) → y(x) + length² / 24 · y''(x)
/// ```
///
/// is the mean over the length to leading order. The curvature is that of the parabola through the place and its
/// two neighbours on a line, at an end of the line through the last three. Around zero the change is of second
/// order in the length.
///
/// It is easily confused with `low_pass` and `timing_jitter` where waves run along the line, and with `misplacement`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GaugeLength {
    /// Prior of the length, in the unit of `positions`, not below zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length: Option<Distribution>,
    /// The axis along which the response changes: one of labels, whose `positions` are given, or of numbers.
    pub axis: String,
    /// Where the labels of the axis stand on a line, such as `{ A = 0.10, B = 0.15 }`; what is not on the line is
    /// left out, and stays as it is.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub positions: BTreeMap<String, f64>,
    /// The unit of `positions`; that of an axis of numbers is its own.
    pub unit: Unit,
}

impl Default for GaugeLength {
    fn default() -> Self {
        let unit = Unit::parse("m").unwrap_or_default();
        Self { length: None, axis: "sensor".to_owned(), positions: BTreeMap::new(), unit }
    }
}

impl GaugeLength {
    fn unknowns(&self, layout: &Layout) -> [Unknown<'_>; 1] {
        [Unknown {
            name: "length",
            symbol: "L",
            measure: Measure::In(self.line().unit(layout)),
            prior: self.length.as_ref(),
            limits: (0.0, f64::INFINITY),
            example: "{ half_normal = 0.02 }",
        }]
    }

    fn line(&self) -> Line<'_> {
        Line { axis: &self.axis, positions: &self.positions, unit: &self.unit }
    }
}

/// The weights of places nearby, at `nodes`, in what a place at `x` shows.
fn weights(nodes: &[f64], x: f64, value: f64) -> [f64; 3] {
    let [at, _, curvature] = lagrange(nodes, x);
    [0, 1, 2].map(|k| at[k] + value * value / 24.0 * curvature[k])
}

/// Their derivatives by the unknown.
fn slopes(nodes: &[f64], x: f64, value: f64) -> [f64; 3] {
    lagrange(nodes, x)[2].map(|curvature| value / 12.0 * curvature)
}

impl Component for GaugeLength {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if let Some(along) = Along::check(context.layout, &self.axis, complaints) {
            Stations::check(&along, &self.positions, 3, complaints);
        }
        check(&self.unknowns(context.layout), context.layout, complaints);
    }
}

impl Effect for GaugeLength {
    fn describe(&self) -> Description {
        Description {
            title: "gauge length: a sensor that is long".into(),
            formula: "y(x) + length² / 24 · y''(x)".into(),
            source: "standard: mean over an interval by Taylor's series".into(),
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
        signs(self.length.as_ref(), 0.0).into_iter().map(|x| vec![x]).collect()
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let prior = |spacing: f64| Distribution::HalfNormal(0.5 * spacing);
        self.line().proposals(situation, 3, "length", prior)
    }

    fn reach(&self) -> Reach {
        Reach::Single
    }
}

lacuna::register!(Effect, "gauge_length", GaugeLength);

#[cfg(test)]
mod tests {
    use super::super::common::testing::effect;

    use lacuna::data::{Axis, Layout, Unit};

    /// One number for each of four places.
    fn layout() -> Layout {
        let axes = vec![Axis::labels("sensor", ["A", "B", "C", "D"])];
        Layout { name: "y".into(), unit: Unit::dimensionless(), axes }
    }

    /// The mean of `x²` over a length is `x² + length² / 12`.
    #[test]
    fn the_mean_of_a_square_is_larger_by_a_twelfth() {
        let options = "length = { half_normal = 1 }\npositions = { A = -1, B = 0.5, C = 1, D = 3 }";
        let response = [1.0, 0.25, 1.0, 9.0];
        let found = effect("gauge_length", options).apply(&layout(), &response, &[0.6]);
        assert!(found.iter().zip(response).all(|(a, y)| (a - y - 0.03).abs() < 1e-14), "{found:?}");
    }
}
