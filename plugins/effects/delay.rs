//! `delay`: a wrong zero of time.

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::Effect;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Situation, Span, Unknown, apart, each_curve, propose,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{Knots, shifted};

/// A delay: each curve is shifted in time, later or earlier.
///
/// The recorder and the model have different zeros of time because of the trigger, cables, filters of the recorder, or
/// a pulse that arrives later than assumed.
///
/// ```text
/// y(t) → y(t - time)
/// ```
///
/// Between its points a curve is interpolated by a cubic spline, which reproduces a sine with eight points per period
/// within 0.2 %. Before its first point and after its last a curve is constant, equal to its first and its last value.
///
/// It is easily confused with `low_pass`, which delays slow signals by its time constant (only fast changes distinguish
/// the two), and with a wrong wave speed, which delays distant sensors more than near ones.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Delay {
    /// Prior of the delay, in the unit of the last axis; a negative delay shifts the curve to earlier times.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<Distribution>,
}

impl CurveEffect for Delay {
    const FORM: Form = Form::Linear;

    fn describe(&self) -> Description {
        Description::new(
            "a delay: a wrong zero of time",
            "y(t - time)",
            "standard: trigger and transport delay",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![Unknown::new("time", "τ", Measure::Axis, &self.time, "{ normal = [0, 1e-5] }")]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        if values[0] == 0.0 {
            return response.to_vec();
        }
        let knots = Knots::of(layout);
        each_curve(layout, response, |y, out| {
            shifted(&knots, y, &knots.slopes(y), values[0], |i, value, _| out[i] = value);
        })
    }

    fn slopes(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let knots = Knots::of(layout);
        let slopes = each_curve(layout, response, |y, out| {
            shifted(&knots, y, &knots.slopes(y), values[0], |i, _, slope| out[i] = -slope);
        });
        Matrix::from_vec(response.len(), 1, slopes)
    }

    fn sizes(&self, layout: &Layout, _: &Situation<'_>) -> Vec<f64> {
        let Some(span) = Span::of(layout) else { return Vec::new() };
        let far = 0.9 * span.duration();
        let times = apart(self.time.as_ref(), (-far, far), 0.5 * span.step, 150);
        times.into_iter().filter(|time| *time != 0.0).collect()
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let Some(span) = Span::of_all(situation) else { return Vec::new() };
        let time = Distribution::Normal([0.0, span.share(0.02)]);
        vec![propose(&[("time", time)])]
    }
}

lacuna::register!(Effect, "delay", Delay);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, largest, uneven};

    /// A normal curve of width 3 steps, later by a time: the same curve about a later centre.
    #[test]
    fn a_delayed_bump_is_the_bump_at_a_later_time() {
        let times = uneven(60, 1.0);
        let bump = |t: f64, centre: f64| (-0.5 * ((t - centre) / 3.0).powi(2)).exp();
        let response: Vec<f64> = times.iter().map(|t| bump(*t, 25.0)).collect();
        let delay = effect("delay", "time = { normal = [0, 1] }");
        for time in [-7.3, -0.4, 0.4, 6.1] {
            let found = delay.apply(&curve(times.clone()), &response, &[time]);
            assert!(largest(&found, &times, 0..60, |t| bump(t, 25.0 + time)) < 3e-3, "{time}");
        }
    }
}
