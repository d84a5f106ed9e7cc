//! `low_pass`: a measuring chain with a first-order lag.

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::Effect;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Situation, Span, Unknown, each_curve, grid, propose,
    spaced_by_ratio,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{Filter, Knots};

/// A first-order lag: the sensor, its cable or its amplifier follows fast changes late and attenuated.
///
/// ```text
/// time_constant · z'(t) = y(t) - z(t),     y → z
/// ```
///
/// The amplitude of a sine of angular frequency ω is multiplied by `1 / sqrt(1 + ω² time_constant²)` and its phase is
/// delayed by `atan(ω time_constant)`; the cut-off frequency is `1 / (2 π time_constant)`. The equation is solved
/// exactly for the spline through the points of a curve, from rest at its first value.
///
/// It is easily confused with `delay`: slow signals are delayed by the time constant without a change of shape.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LowPass {
    /// Prior of the time constant, in the unit of the last axis, zero or positive; zero is no lag.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_constant: Option<Distribution>,
}

impl CurveEffect for LowPass {
    const FORM: Form = Form::Linear;

    fn describe(&self) -> Description {
        Description::new(
            "a first-order lag: a chain that answers late",
            "z with time_constant · z' = y - z",
            "standard: first-order system, as in Oppenheim and Willsky, Signals and Systems",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![
            Unknown::new(
                "time_constant",
                "τ",
                Measure::Axis,
                &self.time_constant,
                "{ half_normal = 1e-5 }",
            )
            .not_negative(),
        ]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let Some(filter) = Filter::new(grid(layout), values[0]) else { return response.to_vec() };
        let knots = Knots::of(layout);
        each_curve(layout, response, |y, out| filter.answer(&knots, y, out))
    }

    fn slopes(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let after = self.formula(layout, response, values);
        Matrix::from_vec(response.len(), 1, Filter::slopes(layout, values[0], response, &after))
    }

    fn sizes(&self, layout: &Layout, _: &Situation<'_>) -> Vec<f64> {
        let range = Span::of(layout).map_or((1e-3, 1.0), |s| (0.2 * s.step, 0.5 * s.duration()));
        spaced_by_ratio(self.time_constant.as_ref(), range, 8)
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let Some(span) = Span::of_all(situation) else { return Vec::new() };
        vec![propose(&[("time_constant", Distribution::HalfNormal(span.share(0.02)))])]
    }
}

lacuna::register!(Effect, "low_pass", LowPass);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, even, largest, uneven};

    /// Gain and phase of a first-order lag, after the beginning has died away.
    #[test]
    fn a_sine_has_the_gain_and_phase_of_the_textbook() {
        let times = even(400, 1.0);
        let omega = std::f64::consts::TAU / 16.0;
        let response: Vec<f64> = times.iter().map(|t| (omega * t).sin()).collect();
        let low_pass = effect("low_pass", "time_constant = { half_normal = 1 }");
        for tau in [0.05, 0.8, 3.0, 20.0] {
            let found = low_pass.apply(&curve(times.clone()), &response, &[tau]);
            let x = omega * tau;
            let exact = |t: f64| (omega * t - x.atan()).sin() / (1.0 + x * x).sqrt();
            let error = largest(&found, &times, 390..399, exact) * (1.0 + x * x).sqrt();
            assert!(error < 3e-4, "{tau}: {error}");
        }
    }

    /// `z = t - T + T exp(-t / T)`.
    #[test]
    fn a_ramp_is_followed_at_a_distance() {
        let times = uneven(30, 1.0);
        let low_pass = effect("low_pass", "time_constant = { half_normal = 1 }");
        for tau in [1e-3, 0.4, 7.0, 1e4] {
            let found = low_pass.apply(&curve(times.clone()), &times, &[tau]);
            let exact = |t: f64| t + tau * (-t / tau).exp_m1();
            let error = largest(&found, &times, 0..30, exact);
            assert!(error < 1e-11 * tau.max(30.0), "{tau}: {error}");
        }
    }
}
