//! `pulse_heating`: heat of the pulse in the structure.

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

/// Pulse heating: the structure itself is warmed by the pulse and stays longer.
///
/// The part that carries the sensor takes up heat at once; strain of the order of the thermal expansion appears
/// within a time of conduction and decays only long after the record.
///
/// ```text
/// y → y + rise · (1 - exp(-(t - start) / time_constant)) from start on
/// ```
///
/// It is easily confused with `offset` (a time constant below a step) and `drift` (one far above the record).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PulseHeating {
    /// Prior of the value it tends to, in the unit of the response, not below zero: what is warmed grows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rise: Option<Distribution>,
    /// Prior of the time in which it comes about, in the unit of the last axis, above zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_constant: Option<Distribution>,
    /// The time at which it begins, in the unit of the last axis; the first time of each curve when left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<f64>,
}

impl PulseHeating {
    fn unknowns(&self) -> [Unknown<'_>; 2] {
        [
            Unknown {
                name: "rise",
                symbol: "b",
                measure: Measure::Response,
                prior: self.rise.as_ref(),
                limits: (0.0, f64::INFINITY),
                example: "{ half_normal = 2e-5 }",
            },
            Unknown {
                name: "time_constant",
                symbol: "τ",
                measure: Measure::Axis,
                prior: self.time_constant.as_ref(),
                limits: (0.0, f64::INFINITY),
                example: "{ log_uniform = [1e-5, 1e-3] }",
            },
        ]
    }
}

impl Component for PulseHeating {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        Span::check(context.layout, complaints);
        check(&self.unknowns(), context.layout, complaints);
    }
}

impl Effect for PulseHeating {
    fn describe(&self) -> Description {
        Description {
            title: "pulse heating: heat of the pulse in the structure".into(),
            formula: "y + rise · (1 - exp(-(t - start) / time_constant))".into(),
            source: "standard: heat taken up at a constant rate of exchange".into(),
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
        let shape = |t: f64| if t < start { 0.0 } else { -(-(t - start) / values[1]).exp_m1() };
        added(layout, response, values[0], |i| shape(at[i]))
    }

    fn by_parameters(&self, layout: &Layout, _: &[f64], values: &[f64]) -> Matrix {
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

    fn push_forward(&self, _: &Layout, _: &[f64], _: &[f64], tangent: &[f64]) -> Vec<f64> {
        tangent.to_vec()
    }

    fn starts(&self, layout: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        let range = Span::of(layout).map_or((1e-3, 1.0), |s| (0.3 * s.step, 2.0 * s.duration()));
        let times = spaced_by_ratio(self.time_constant.as_ref(), range, 10);
        all(&[signs(self.rise.as_ref(), 0.0), times])
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

    /// What is missing to the end falls by the same factor in equal times (Newton's law of cooling).
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
