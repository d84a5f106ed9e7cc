//! `gauge_length`: a sensor of finite length.

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

/// Gauge length: a sensor measures the mean over its length, the model gives the value at a point.
///
/// ```text
/// y(x) → y(x) + length² / 24 · y''(x)
/// ```
///
/// is the mean over the length to leading order. The second derivative is that of the parabola through the place and
/// its two neighbours on a line, or at an end of the line through the last three. Around zero the change is of second
/// order in the length, so that short lengths cannot be detected.
///
/// It is easily confused with `low_pass` and `timing_jitter` where waves run along the line, and with `misplacement`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GaugeLength {
    /// Prior of the length, in the unit of `positions`, zero or positive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length: Option<Distribution>,
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

impl Default for GaugeLength {
    fn default() -> Self {
        let unit = Unit::parse("m").unwrap_or_default();
        Self { length: None, axis: "sensor".to_owned(), positions: BTreeMap::new(), unit }
    }
}

impl GaugeLength {
    fn line(&self) -> Line<'_> {
        Line { axis: &self.axis, positions: &self.positions, unit: &self.unit }
    }
}

/// Weights of the neighbouring places at `nodes` in the value that a sensor of length `value` at `x` shows.
fn weights(nodes: &[f64], x: f64, value: f64) -> [f64; 3] {
    let [at, _, curvature] = lagrange(nodes, x);
    [0, 1, 2].map(|k| at[k] + value * value / 24.0 * curvature[k])
}

/// Derivatives of [`weights`] with respect to the length.
fn slopes(nodes: &[f64], x: f64, value: f64) -> [f64; 3] {
    lagrange(nodes, x)[2].map(|curvature| value / 12.0 * curvature)
}

impl CurveEffect for GaugeLength {
    const FORM: Form = Form::Linear;

    fn describe(&self) -> Description {
        Description::new(
            "gauge length: a sensor that is long",
            "y(x) + length² / 24 · y''(x)",
            "standard: mean over an interval by Taylor's series",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![
            Unknown::new(
                "length",
                "L",
                Measure::Along(self.axis.clone(), self.unit.clone()),
                &self.length,
                "{ half_normal = 0.02 }",
            )
            .not_negative(),
        ]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        self.line().combined(layout, response, |nodes, x| weights(nodes, x, values[0]))
    }

    fn slopes(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        self.line().combined_slopes(layout, response, |nodes, x| slopes(nodes, x, values[0]))
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let prior = |spacing: f64| Distribution::HalfNormal(0.5 * spacing);
        self.line().proposals(situation, 3, "length", prior)
    }

    fn reach(&self) -> Reach {
        Reach::Single
    }

    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if let Some(along) = Along::check(context.layout, &self.axis, complaints) {
            Stations::check(&along, &self.positions, 3, complaints);
        }
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
