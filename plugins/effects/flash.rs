//! `flash`: what the pulse does to the sensor itself.

use lacuna::data::Layout;
use lacuna::linalg::Matrix;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::{Description, Situation};
use lacuna::plugin::{Component, Context, Effect, Hyperparameter};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{
    Measure, Span, Unknown, added, added_slopes, all, check, grid, parameters, propose, signs,
    spaced_by_ratio,
};

/// A flash: a disturbance of the sensor at the moment of the pulse, which decays.
///
/// Radiation makes an optical fibre glow, a discharge couples into a cable, light reaches a diode.
///
/// ```text
/// y → y + amplitude · exp(-(t - start) / decay) from start on
/// ```
///
/// It is easily confused with `offset` where it decays slowly, and with what the model itself says of the first
/// moments.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Flash {
    /// Prior of the amplitude at its start, in the unit of the response, of either sign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<Distribution>,
    /// Prior of the time in which it falls to 1/e, in the unit of the last axis, above zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decay: Option<Distribution>,
    /// The time at which it begins, in the unit of the last axis; the first time of each curve when left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<f64>,
}

impl Flash {
    fn unknowns(&self) -> [Unknown<'_>; 2] {
        [
            Unknown {
                name: "amplitude",
                symbol: "A",
                measure: Measure::Response,
                prior: self.amplitude.as_ref(),
                limits: (f64::NEG_INFINITY, f64::INFINITY),
                example: "{ normal = [0, 1e-4] }",
            },
            Unknown {
                name: "decay",
                symbol: "τ",
                measure: Measure::Axis,
                prior: self.decay.as_ref(),
                limits: (0.0, f64::INFINITY),
                example: "{ log_uniform = [3e-6, 1e-4] }",
            },
        ]
    }
}

impl Component for Flash {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        Span::check(context.layout, complaints);
        check(&self.unknowns(), context.layout, complaints);
    }
}

impl Effect for Flash {
    fn describe(&self) -> Description {
        Description {
            title: "a flash: what the pulse does to the sensor itself".into(),
            formula: "y + amplitude · exp(-(t - start) / decay)".into(),
            source: "standard: exponential decay".into(),
        }
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        parameters(&self.unknowns(), layout)
    }

    fn absent(&self, layout: &Layout) -> Vec<f64> {
        let mut values: Vec<f64> = self.parameters(layout).iter().map(|own| own.start).collect();
        values[0] = 0.0;
        values
    }

    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let at = grid(layout);
        let start = self.start.unwrap_or(at[0]);
        let shape = |t: f64| if t < start { 0.0 } else { (-(t - start) / values[1]).exp() };
        added(layout, response, values[0], |i| shape(at[i]))
    }

    fn by_parameters(&self, layout: &Layout, _: &[f64], values: &[f64]) -> Matrix {
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

    fn push_forward(&self, _: &Layout, _: &[f64], _: &[f64], tangent: &[f64]) -> Vec<f64> {
        tangent.to_vec()
    }

    fn starts(&self, layout: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        let range = Span::of(layout).map_or((1e-3, 1.0), |s| (0.3 * s.step, s.duration()));
        all(&[signs(self.amplitude.as_ref(), 0.0), spaced_by_ratio(self.decay.as_ref(), range, 10)])
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
