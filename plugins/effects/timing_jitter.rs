//! `timing_jitter`: random delays of the replicates.

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::Effect;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Situation, Span, Unknown, each_curve, propose,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{Knots, shifted};

/// Timing jitter: the replicates have random delays, so that their mean is a blurred curve.
///
/// The delay of each replicate is normally distributed with mean zero and standard deviation `deviation`. The mean over
/// the delays smooths every fast change; the amplitude of a sine of angular frequency ω is multiplied by
/// `exp(-ω² deviation² / 2)`.
///
/// ```text
/// y(t) → mean of y(t - deviation · z) over normal z
/// ```
///
/// The mean is computed as a sum over fifteen delays. Curves are interpolated by splines between their points and
/// constant before the first and after the last. Around zero the change is of second order, so that a small jitter
/// cannot be detected.
///
/// It is easily confused with `low_pass`, which also delays, with `gauge_length`, and with noise that is larger where
/// the curve is steep, which jitter causes as well.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TimingJitter {
    /// Prior of the standard deviation of the delays, in the unit of the last axis, zero or positive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deviation: Option<Distribution>,
}

/// Nodes and weights of a mean over the standard normal distribution by the trapezoidal rule, whose error for smooth
/// functions is the truncation error at its ends, 2e-7 (Trefethen and Weideman, SIAM Review 56 (2014) 385).
fn nodes() -> impl Iterator<Item = (f64, f64)> {
    let node = |k: i32| 0.75 * f64::from(k);
    let density = |z: f64| (-0.5 * z * z).exp();
    let total: f64 = (-7..=7).map(|k| density(node(k))).sum();
    (-7..=7).map(move |k| (node(k), density(node(k)) / total))
}

impl CurveEffect for TimingJitter {
    const FORM: Form = Form::Linear;

    fn describe(&self) -> Description {
        Description::new(
            "jitter of the timing: replicates that begin at random",
            "mean of y(t - deviation · z) over normal z",
            "standard: mean of signals with jitter, which passes exp(-ω² deviation² / 2)",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![
            Unknown::new(
                "deviation",
                "σ",
                Measure::Axis,
                &self.deviation,
                "{ half_normal = 1e-5 }",
            )
            .not_negative(),
        ]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        if values[0] == 0.0 {
            return response.to_vec();
        }
        let knots = Knots::of(layout);
        each_curve(layout, response, |y, out| {
            let slopes = knots.slopes(y);
            for (z, weight) in nodes() {
                let add = |i: usize, value: f64, _: f64| out[i] += weight * value;
                shifted(&knots, y, &slopes, values[0] * z, add);
            }
        })
    }

    fn slopes(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let knots = Knots::of(layout);
        let by_deviation = each_curve(layout, response, |y, out| {
            let slopes = knots.slopes(y);
            for (z, weight) in nodes() {
                let add = |i: usize, _: f64, slope: f64| out[i] -= weight * z * slope;
                shifted(&knots, y, &slopes, values[0] * z, add);
            }
        });
        Matrix::from_vec(response.len(), 1, by_deviation)
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let Some(span) = Span::of_all(situation) else { return Vec::new() };
        vec![propose(&[("deviation", Distribution::HalfNormal(span.share(0.01)))])]
    }
}

lacuna::register!(Effect, "timing_jitter", TimingJitter);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, even, largest};

    #[test]
    fn a_sine_shrinks_as_the_mean_over_normal_phases_says() {
        let times = even(400, 1.0);
        let omega = std::f64::consts::TAU / 20.0;
        let response: Vec<f64> = times.iter().map(|t| (omega * t).sin()).collect();
        let jitter = effect("timing_jitter", "deviation = { half_normal = 1 }");
        for sigma in [0.3, 2.0, 5.0] {
            let found = jitter.apply(&curve(times.clone()), &response, &[sigma]);
            let left = (-0.5 * (omega * sigma).powi(2)).exp();
            let error = largest(&found, &times, 40..360, |t| left * (omega * t).sin());
            assert!(error < 1e-4, "{sigma}: {error}");
        }
    }
}
