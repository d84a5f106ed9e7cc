//! `flash`: a disturbance of the sensor by the pulse.

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::Effect;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Situation, Span, Unknown, added, added_slopes, grid,
    propose, spaced_by_ratio,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

/// A flash: a disturbance of the sensor at the moment of the pulse, which decays exponentially.
///
/// Typical causes: radiation-induced light in an optical fibre, a discharge coupling into a cable, light reaching a
/// diode.
///
/// ```text
/// y → y + amplitude · exp(-(t - start) / decay) from start on
/// ```
///
/// It is easily confused with `offset` if it decays slowly, and with the model's own response in the first moments.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Flash {
    /// Prior of the initial amplitude, in the unit of the response; either sign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<Distribution>,
    /// Prior of the decay time (to 1/e), in the unit of the last axis, above zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decay: Option<Distribution>,
    /// Time at which the disturbance begins, in the unit of the last axis. Default: the first time of each curve.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<f64>,
}

impl CurveEffect for Flash {
    const FORM: Form = Form::Additive;

    fn describe(&self) -> Description {
        Description::new(
            "a flash: what the pulse does to the sensor itself",
            "y + amplitude · exp(-(t - start) / decay)",
            "standard: exponential decay",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![
            Unknown::new(
                "amplitude",
                "A",
                Measure::Response,
                &self.amplitude,
                "{ normal = [0, 1e-4] }",
            ),
            Unknown::new(
                "decay",
                "τ",
                Measure::Axis,
                &self.decay,
                "{ log_uniform = [3e-6, 1e-4] }",
            )
            .not_negative(),
        ]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let at = grid(layout);
        let start = self.start.unwrap_or(at[0]);
        let shape = |t: f64| if t < start { 0.0 } else { (-(t - start) / values[1]).exp() };
        added(layout, response, values[0], |i| shape(at[i]))
    }

    fn slopes(&self, layout: &Layout, _: &[f64], values: &[f64]) -> Matrix {
        let at = grid(layout);
        let start = self.start.unwrap_or(at[0]);
        added_slopes(layout, 2, |i, row| {
            let u = (at[i] - start) / values[1];
            if u >= 0.0 {
                row[0] = (-u).exp();
                row[1] = values[0] * u / values[1] * row[0];
            }
        })
    }

    fn indices(&self, layout: &Layout) -> Option<Vec<Vec<f64>>> {
        let range = Span::of(layout).map_or((1e-3, 1.0), |s| (0.3 * s.step, s.duration()));
        Some(vec![spaced_by_ratio(self.decay.as_ref(), range, 10)])
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let Some(span) = Span::of_all(situation) else { return Vec::new() };
        let mut table = propose(&[
            ("amplitude", Distribution::Normal([0.0, 0.5 * situation.scale()])),
            ("decay", Distribution::LogUniform([0.3 * span.step, span.share(0.2)])),
        ]);
        span.add_pulse(&mut table);
        vec![table]
    }
}

lacuna::register!(Effect, "flash", Flash);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, even, largest};

    #[test]
    fn it_begins_at_its_start_and_falls_to_one_over_e() {
        let times: Vec<f64> = even(9, 0.5).iter().map(|t| t - 1.0).collect();
        let options = "amplitude = { normal = [0, 1] }\ndecay = { half_normal = 1 }\nstart = 0.0";
        let found = effect("flash", options).apply(&curve(times.clone()), &[1.0; 9], &[3.0, 2.0]);
        let exact = |t: f64| if t < 0.0 { 1.0 } else { 1.0 + 3.0 * (-0.5 * t).exp() };
        assert!(largest(&found, &times, 0..9, exact) < 1e-15);
        assert!((found[6] - 1.0 - 3.0 / std::f64::consts::E).abs() < 1e-15);
    }
}
