//! `saturation`: a sensor at its limit.

use lacuna::data::Layout;
use lacuna::linalg::Matrix;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::{Description, Situation};
use lacuna::plugin::{Component, Context, Effect, Hyperparameter};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{Measure, Unknown, check, parameters, propose, spaced_by_ratio};

/// Saturation: large values come out smaller than they are.
///
/// The amplifier or the sensor is driven towards its limit, or the material yields.
///
/// ```text
/// y → limit · tanh(y / limit),     inverse_limit = 1 / limit
/// ```
///
/// Small values stay; no value passes the limit. Around zero the change is of second order in the inverse limit, as
/// a distant limit cannot be seen.
///
/// It is easily confused with `gain` where all values are of one size, and with `damping` where the first are the
/// largest.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Saturation {
    /// Prior of one over the limit, in the inverse unit of the response, not below zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inverse_limit: Option<Distribution>,
}

impl Saturation {
    fn unknowns(&self) -> [Unknown<'_>; 1] {
        [Unknown {
            name: "inverse_limit",
            symbol: "1/L",
            measure: Measure::PerResponse,
            prior: self.inverse_limit.as_ref(),
            limits: (0.0, f64::INFINITY),
            example: "{ half_normal = 1e4 }",
        }]
    }
}

/// `tanh(x) / x`.
fn shrink(x: f64) -> f64 {
    if x.abs() < 1e-3 { 1.0 - x * x * (1.0 / 3.0 - x * x * 2.0 / 15.0) } else { x.tanh() / x }
}

/// Its derivative by `x`; by its series where the formula loses digits.
fn shrink_slope(x: f64) -> f64 {
    if x.abs() < 0.02 {
        let square = x * x;
        x * (-2.0 / 3.0 + square * (8.0 / 15.0 - square * 34.0 / 105.0))
    } else {
        (x * x.cosh().powi(-2) - x.tanh()) / (x * x)
    }
}

impl Component for Saturation {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        check(&self.unknowns(), context.layout, complaints);
    }
}

impl Effect for Saturation {
    fn describe(&self) -> Description {
        Description {
            title: "saturation: a sensor at its limit".into(),
            formula: "limit · tanh(y / limit)".into(),
            source: "standard: smooth saturation".into(),
        }
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        parameters(&self.unknowns(), layout)
    }

    fn absent(&self, _: &Layout) -> Vec<f64> {
        vec![0.0]
    }

    fn apply(&self, _: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        response.iter().map(|y| y * shrink(values[0] * y)).collect()
    }

    fn by_parameters(&self, _: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let slope = |y: &f64| y * y * shrink_slope(values[0] * y);
        Matrix::from_vec(response.len(), 1, response.iter().map(slope).collect())
    }

    fn push_forward(
        &self,
        _: &Layout,
        response: &[f64],
        values: &[f64],
        tangent: &[f64],
    ) -> Vec<f64> {
        let slope = |y: f64| (values[0] * y).cosh().powi(-2);
        response.iter().zip(tangent).map(|(y, v)| v * slope(*y)).collect()
    }

    fn starts(&self, _: &Layout, situation: &Situation<'_>) -> Vec<Vec<f64>> {
        let unit = 1.0 / situation.scale();
        let limits = spaced_by_ratio(self.inverse_limit.as_ref(), (0.05 * unit, 3.0 * unit), 6);
        limits.into_iter().map(|limit| vec![limit]).collect()
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let unit = 1.0 / situation.scale();
        vec![propose(&[("inverse_limit", Distribution::HalfNormal(0.3 * unit))])]
    }
}

lacuna::register!(Effect, "saturation", Saturation);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, even};

    /// tanh 1 = 0.76159 41559 55764 88812 (Abramowitz and Stegun, table 4.15).
    #[test]
    fn large_values_come_out_at_the_limit() {
        let saturation = effect("saturation", "inverse_limit = { half_normal = 1 }");
        let found = saturation.apply(&curve(even(4, 1.0)), &[2.0, -2.0, 1e-9, 400.0], &[0.5]);
        assert!((found[0] - 2.0 * 0.761_594_155_955_764_9).abs() < 1e-15);
        assert_eq!((found[1], found[2], found[3]), (-found[0], 1e-9, 2.0));
    }

    #[test]
    fn the_slope_is_the_same_on_both_sides_of_its_series() {
        let direct = |x: f64| (x * x.cosh().powi(-2) - x.tanh()) / (x * x);
        assert!((super::shrink_slope(0.0199) / direct(0.0199) - 1.0).abs() < 1e-9);
    }
}
