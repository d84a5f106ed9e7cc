//! `saturation`: a sensor at its limit.

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Situation, Unknown, propose, spaced_by_ratio,
};
use lacuna::plugin::{Context, Effect};
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

/// Saturation: large values are measured smaller than they are.
///
/// Typical causes: the amplifier or the sensor is driven towards its limit, or the material yields.
///
/// ```text
/// y → limit · tanh(y / limit),     inverse_limit = 1 / limit
/// ```
///
/// Small values are unchanged and no value exceeds the limit. Around zero the change is of second order in the inverse
/// limit, so that a limit far above the values cannot be detected.
///
/// It is easily confused with `gain` if all values are of similar size, and with `damping` if the first values are the
/// largest.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Saturation {
    /// Prior of the inverse limit, in the inverse unit of the response, zero or positive; zero is no saturation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inverse_limit: Option<Distribution>,
}

/// `tanh(x) / x`.
fn shrink(x: f64) -> f64 {
    if x.abs() < 1e-3 { 1.0 - x * x * (1.0 / 3.0 - x * x * 2.0 / 15.0) } else { x.tanh() / x }
}

/// Derivative of [`shrink`] with respect to `x`, by its series where the closed form suffers from cancellation.
fn shrink_slope(x: f64) -> f64 {
    if x.abs() < 0.02 {
        let square = x * x;
        x * (-2.0 / 3.0 + square * (8.0 / 15.0 - square * 34.0 / 105.0))
    } else {
        (x * x.cosh().powi(-2) - x.tanh()) / (x * x)
    }
}

impl CurveEffect for Saturation {
    const FORM: Form = Form::Nonlinear;

    fn describe(&self) -> Description {
        Description::new(
            "saturation: a sensor at its limit",
            "limit · tanh(y / limit)",
            "standard: smooth saturation",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![
            Unknown::new(
                "inverse_limit",
                "1/L",
                Measure::PerResponse,
                &self.inverse_limit,
                "{ half_normal = 1e4 }",
            )
            .not_negative(),
        ]
    }

    fn formula(&self, _: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        response.iter().map(|y| y * shrink(values[0] * y)).collect()
    }

    fn slopes(&self, _: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let slope = |y: &f64| y * y * shrink_slope(values[0] * y);
        Matrix::from_vec(response.len(), 1, response.iter().map(slope).collect())
    }

    fn along(&self, _: &Layout, response: &[f64], values: &[f64], tangent: &[f64]) -> Vec<f64> {
        let slope = |y: f64| (values[0] * y).cosh().powi(-2);
        response.iter().zip(tangent).map(|(y, v)| v * slope(*y)).collect()
    }

    fn sizes(&self, _: &Layout, situation: &Situation<'_>) -> Vec<f64> {
        let unit = 1.0 / situation.scale();
        spaced_by_ratio(self.inverse_limit.as_ref(), (0.05 * unit, 3.0 * unit), 6)
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let unit = 1.0 / situation.scale();
        vec![propose(&[("inverse_limit", Distribution::HalfNormal(0.3 * unit))])]
    }

    fn check(&self, _: &Context<'_>, _: &mut Complaints<'_>) {}
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
