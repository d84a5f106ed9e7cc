//! `skeleton`: a gain that changes along the curve.

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::Effect;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Situation, Span, Unknown, each_curve, grid,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

/// A slope of the gain: all values of a curve are multiplied by a factor that is one in its middle and changes linearly
/// along the last axis.
///
/// An amplifier that warms up or an adhesive that creeps. With `u` from -1 at the first point of a curve to 1 at the
/// last,
///
/// ```text
/// y → (1 + slope · u) · y
/// ```
///
/// It is easily confused with `damping`, whose factor is an exponential, and needs a response that is not near zero at
/// the ends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Skeleton {
    /// Prior of the slope, dimensionless; zero means no effect. By default 10 % from the middle to either end.
    pub slope: Distribution,
}

impl Default for Skeleton {
    fn default() -> Self {
        Self { slope: Distribution::Normal([0.0, 0.1]) }
    }
}

/// The place `u` of each value of a curve; all zero for a curve of one point.
fn places(at: &[f64]) -> Vec<f64> {
    let [first, last] = [at.first(), at.last()].map(|t| t.copied().unwrap_or(0.0));
    let half = 0.5 * (last - first);
    at.iter().map(|t| if half > 0.0 { (t - first) / half - 1.0 } else { 0.0 }).collect()
}

impl CurveEffect for Skeleton {
    const FORM: Form = Form::Linear;

    fn describe(&self) -> Description {
        Description::new(
            "a slope of the gain: a sensitivity that changes along the curve",
            "(1 + slope · u) · y",
            "standard: sensitivity drift of a measuring chain",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![Unknown::new("slope", "g1", Measure::Number, &self.slope, "{ normal = [0, 0.1] }")]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let places = places(grid(layout));
        each_curve(layout, response, |y, out| {
            for (i, out) in out.iter_mut().enumerate() {
                *out = (1.0 + values[0] * places[i]) * y[i];
            }
        })
    }

    fn slopes(&self, layout: &Layout, response: &[f64], _: &[f64]) -> Matrix {
        let places = places(grid(layout));
        let by_slope = each_curve(layout, response, |y, out| {
            out.iter_mut().enumerate().for_each(|(i, out)| *out = places[i] * y[i]);
        });
        Matrix::from_vec(response.len(), 1, by_slope)
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        // The defaults, where there is a curve at all.
        Span::of_all(situation).map(|_| Table::new()).into_iter().collect()
    }
}

lacuna::register!(Effect, "skeleton", Skeleton);

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::data::{Axis, Unit};

    #[test]
    fn it_keeps_the_contract() {
        assert_eq!(lacuna_contract::effect("skeleton", &Skeleton::default()), Ok(()));
    }

    #[test]
    fn the_ends_of_each_curve_change_and_its_middle_does_not() {
        let times = Axis::grid("time", vec![2.0, 3.0, 4.0], Unit::dimensionless());
        let axes = vec![Axis::labels("sensor", ["A", "B"]), times];
        let layout = Layout { axes, ..Layout::number("y") };
        let response = [1.0, 2.0, 3.0, 4.0, 4.0, 4.0];
        let found = Skeleton::default().formula(&layout, &response, &[0.5]);
        assert_eq!(found, [0.5, 2.0, 4.5, 2.0, 4.0, 6.0]);
    }
}
