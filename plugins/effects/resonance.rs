//! `resonance`: a vibration of its own.

use std::f64::consts::{FRAC_PI_2, TAU};

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
    Measure, Span, Unknown, added, added_slopes, all, apart, check, grid, parameters, propose,
    signs,
};

/// A resonance: a vibration that dies away, added to each curve.
///
/// The structure still rings from the pulse before, or a part that the model does not have rings by itself.
///
/// ```text
/// y → y + amplitude · exp(-damping · ω · (t - t0)) · sin(ω · (t - t0) + phase),     ω = 2 π frequency
/// ```
///
/// with `t0` the first time of the curve. The amplitude has either sign and the phase lies in half a circle, so
/// that each vibration is written in one way only.
///
/// It is easily confused with `echo` where the signal rings itself, and for low frequencies with `offset` and
/// `drift`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Resonance {
    /// Prior of the amplitude, in the unit of the response, of either sign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<Distribution>,
    /// Prior of the frequency, in the inverse unit of the last axis, not below zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frequency: Option<Distribution>,
    /// Prior of the damping ratio, a number not below zero. By default of the order of 1 %: steel structures have
    /// 0.2 to 3 %.
    pub damping: Distribution,
    /// Prior of the phase in radians, from -π/2 to π/2 by default.
    pub phase: Distribution,
}

impl Default for Resonance {
    fn default() -> Self {
        Self {
            amplitude: None,
            frequency: None,
            damping: Distribution::HalfNormal(0.015),
            phase: Distribution::Uniform([-FRAC_PI_2, FRAC_PI_2]),
        }
    }
}

impl Resonance {
    fn unknowns(&self) -> [Unknown<'_>; 4] {
        [
            Unknown {
                name: "amplitude",
                symbol: "A",
                measure: Measure::Response,
                prior: self.amplitude.as_ref(),
                limits: (f64::NEG_INFINITY, f64::INFINITY),
                example: "{ normal = [0, 1e-5] }",
            },
            Unknown {
                name: "frequency",
                symbol: "f",
                measure: Measure::PerAxis,
                prior: self.frequency.as_ref(),
                limits: (0.0, f64::INFINITY),
                example: "{ uniform = [1e3, 2e4] }",
            },
            Unknown {
                name: "damping",
                symbol: "ζ",
                measure: Measure::Number,
                prior: Some(&self.damping),
                limits: (0.0, f64::INFINITY),
                example: "{ half_normal = 0.01 }",
            },
            Unknown {
                name: "phase",
                symbol: "φ",
                measure: Measure::Number,
                prior: Some(&self.phase),
                limits: (f64::NEG_INFINITY, f64::INFINITY),
                example: "{ uniform = [-1.5, 1.5] }",
            },
        ]
    }
}

impl Component for Resonance {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        Span::check(context.layout, complaints);
        check(&self.unknowns(), context.layout, complaints);
    }
}

impl Effect for Resonance {
    fn describe(&self) -> Description {
        Description {
            title: "a resonance: a vibration of its own".into(),
            formula: "y + amplitude · exp(-damping · ω · u) · sin(ω · u + phase), u = t - t0"
                .into(),
            source: "standard: free vibration, as in Meirovitch, Fundamentals of Vibrations".into(),
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
        let omega = TAU * values[1];
        added(layout, response, values[0], |i| {
            let u = omega * (at[i] - at[0]);
            (-values[2] * u).exp() * (u + values[3]).sin()
        })
    }

    fn by_parameters(&self, layout: &Layout, _: &[f64], values: &[f64]) -> Matrix {
        let at = grid(layout);
        added_slopes(layout, 4, |i, row| {
            let time = at[i] - at[0];
            let u = TAU * values[1] * time;
            let (sin, cos) = (u + values[3]).sin_cos();
            let left = (-values[2] * u).exp();
            row[0] = left * sin;
            row[1] = values[0] * left * TAU * time * (cos - values[2] * sin);
            row[2] = -values[0] * left * u * sin;
            row[3] = values[0] * left * cos;
        })
    }

    fn push_forward(&self, _: &Layout, _: &[f64], _: &[f64], tangent: &[f64]) -> Vec<f64> {
        tangent.to_vec()
    }

    fn starts(&self, layout: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        let Some(span) = Span::of(layout) else { return Vec::new() };
        // The peak of a vibration is as wide as one over the duration: two starts to each half of it.
        let width = 1.0 / span.duration();
        let range = (0.25 * width, 0.5 / span.step);
        all(&[
            signs(self.amplitude.as_ref(), 0.0),
            apart(self.frequency.as_ref(), range, 0.25 * width, 95),
            vec![self.damping.quantile(0.5)],
            vec![self.phase.quantile(0.5)],
        ])
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let Some(span) = Span::of_all(situation) else { return Vec::new() };
        let (low, high) = (0.5 / span.duration(), 0.4 / span.step);
        if low >= high {
            return Vec::new();
        }
        vec![propose(&[
            ("amplitude", Distribution::Normal([0.0, 0.2 * situation.scale()])),
            ("frequency", Distribution::Uniform([low, high])),
            ("damping", self.damping.clone()),
            ("phase", self.phase.clone()),
        ])]
    }
}

lacuna::register!(Effect, "resonance", Resonance);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, even};

    /// `x'' + 2 ζ ω x' + (1 + ζ²) ω² x = 0`, by differences of fourth order of the step.
    #[test]
    fn it_swings_freely() {
        let step = 1e-4;
        let options = "amplitude = { normal = [0, 1] }\nfrequency = { uniform = [0, 9] }";
        let resonance = effect("resonance", options);
        let layout = curve(even(200, step));
        let x = resonance.apply(&layout, &[0.0; 200], &[1.5, 8.0, 0.1, 0.4]);
        assert!((x[0] - 1.5 * 0.4_f64.sin()).abs() < 1e-15);
        let omega = std::f64::consts::TAU * 8.0;
        for w in x.windows(3) {
            let (second, first) = (w[0] - 2.0 * w[1] + w[2], (w[2] - w[0]) / 2.0);
            let sum =
                second / (step * step) + 0.2 * omega * first / step + 1.01 * omega * omega * w[1];
            assert!(sum.abs() < 1e-4 * 1.5 * omega * omega, "{sum}");
        }
    }
}
