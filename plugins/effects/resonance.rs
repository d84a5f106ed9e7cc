//! `resonance`: a decaying vibration that the model lacks.

use std::f64::consts::{FRAC_PI_2, TAU};

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::Effect;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Situation, Span, Unknown, added, added_slopes, apart,
    grid, propose,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

/// A resonance: a decaying vibration added to each curve.
///
/// Typical causes: the structure still vibrates from the previous pulse, or a part that the model lacks vibrates at its
/// own frequency.
///
/// ```text
/// y → y + amplitude · exp(-damping · ω · (t - t0)) · sin(ω · (t - t0) + phase),     ω = 2 π frequency
/// ```
///
/// with `t0` the first time of the curve. The amplitude may have either sign and the phase is restricted to half a
/// circle, so that each vibration is represented only once.
///
/// It is easily confused with `echo` if the signal itself oscillates, and at low frequencies with `offset` and `drift`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Resonance {
    /// Prior of the amplitude, in the unit of the response; either sign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<Distribution>,
    /// Prior of the frequency, in the inverse unit of the last axis, zero or positive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frequency: Option<Distribution>,
    /// Prior of the damping ratio, dimensionless, zero or positive. Default: of the order of 1 %; steel structures have
    /// 0.2 to 3 %.
    pub damping: Distribution,
    /// Prior of the phase, in radians. Default: uniform from -π/2 to π/2.
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

impl CurveEffect for Resonance {
    const FORM: Form = Form::Additive;

    fn describe(&self) -> Description {
        Description::new(
            "a resonance: a vibration of its own",
            "y + amplitude · exp(-damping · ω · u) · sin(ω · u + phase), u = t - t0",
            "standard: free vibration, as in Meirovitch, Fundamentals of Vibrations",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![
            Unknown::new(
                "amplitude",
                "A",
                Measure::Response,
                &self.amplitude,
                "{ normal = [0, 1e-5] }",
            ),
            Unknown::new(
                "frequency",
                "f",
                Measure::PerAxis,
                &self.frequency,
                "{ uniform = [1e3, 2e4] }",
            )
            .not_negative(),
            Unknown::new("damping", "ζ", Measure::Number, &self.damping, "{ half_normal = 0.01 }")
                .not_negative(),
            Unknown::new("phase", "φ", Measure::Number, &self.phase, "{ uniform = [-1.5, 1.5] }"),
        ]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let at = grid(layout);
        let omega = TAU * values[1];
        added(layout, response, values[0], |i| {
            let u = omega * (at[i] - at[0]);
            (-values[2] * u).exp() * (u + values[3]).sin()
        })
    }

    fn slopes(&self, layout: &Layout, _: &[f64], values: &[f64]) -> Matrix {
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

    fn indices(&self, layout: &Layout) -> Option<Vec<Vec<f64>>> {
        let span = Span::of(layout)?;
        // The peak of a vibration is as wide as one over the duration: two starts to each half of it.
        let width = 1.0 / span.duration();
        let range = (0.25 * width, 0.5 / span.step);
        Some(vec![
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
