//! `pulse_heating`: thermal expansion of the structure after the pulse.

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

/// Pulse heating: the structure is heated by the pulse and expands.
///
/// The part to which the sensor is attached absorbs heat immediately; a strain of the order of the thermal expansion
/// develops within a heat conduction time and decays only long after the record.
///
/// ```text
/// y → y + rise · (1 - exp(-(t - start) / time_constant)) from start on
/// ```
///
/// It is easily confused with `offset` (time constant below a time step) and `drift` (time constant far above the
/// length of the record).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PulseHeating {
    /// Prior of the final value, in the unit of the response, zero or positive, since heated material expands.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rise: Option<Distribution>,
    /// Prior of the time constant, in the unit of the last axis, above zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_constant: Option<Distribution>,
    /// Time at which the heating begins, in the unit of the last axis. Default: the first time of each curve.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<f64>,
}

impl CurveEffect for PulseHeating {
    const FORM: Form = Form::Additive;

    fn describe(&self) -> Description {
        Description::new(
            "pulse heating: heat of the pulse in the structure",
            "y + rise · (1 - exp(-(t - start) / time_constant))",
            "standard: heat taken up at a constant rate of exchange",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![
            Unknown::new("rise", "b", Measure::Response, &self.rise, "{ half_normal = 2e-5 }")
                .not_negative(),
            Unknown::new(
                "time_constant",
                "τ",
                Measure::Axis,
                &self.time_constant,
                "{ log_uniform = [1e-5, 1e-3] }",
            )
            .not_negative(),
        ]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let at = grid(layout);
        let start = self.start.unwrap_or(at[0]);
        let shape = |t: f64| if t < start { 0.0 } else { -(-(t - start) / values[1]).exp_m1() };
        added(layout, response, values[0], |i| shape(at[i]))
    }

    fn slopes(&self, layout: &Layout, _: &[f64], values: &[f64]) -> Matrix {
        let at = grid(layout);
        let start = self.start.unwrap_or(at[0]);
        added_slopes(layout, 2, |i, row| {
            let u = (at[i] - start) / values[1];
            if u >= 0.0 {
                row[0] = -(-u).exp_m1();
                row[1] = -values[0] * u / values[1] * (-u).exp();
            }
        })
    }

    fn indices(&self, layout: &Layout) -> Option<Vec<Vec<f64>>> {
        let range = Span::of(layout).map_or((1e-3, 1.0), |s| (0.3 * s.step, 2.0 * s.duration()));
        Some(vec![spaced_by_ratio(self.time_constant.as_ref(), range, 10)])
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let Some(span) = Span::of_all(situation) else { return Vec::new() };
        // Faster it is an offset, slower a drift.
        let bends = [span.step.min(0.1 * span.duration()), 0.5 * span.duration()];
        let mut table = propose(&[
            ("rise", Distribution::HalfNormal(0.2 * situation.scale())),
            ("time_constant", Distribution::LogUniform(bends)),
        ]);
        span.add_pulse(&mut table);
        vec![table]
    }
}

lacuna::register!(Effect, "pulse_heating", PulseHeating);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, even};

    /// The difference to the final value decreases by the same factor in equal times (Newton's law of cooling).
    #[test]
    fn it_tends_to_its_end() {
        let options = "rise = { half_normal = 1 }\ntime_constant = { half_normal = 1 }";
        let heating = effect("pulse_heating", options);
        let found = heating.apply(&curve(even(8, 1.0)), &[0.0; 8], &[2.0, 1.5]);
        assert_eq!(found[0], 0.0);
        let factor = (-1.0 / 1.5_f64).exp();
        for w in found.windows(2) {
            assert!((2.0 - w[1] - factor * (2.0 - w[0])).abs() < 1e-14);
        }
    }
}
