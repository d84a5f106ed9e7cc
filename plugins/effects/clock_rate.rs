//! `clock_rate`: a clock that runs too fast or too slow.

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::Effect;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Reach, Situation, Span, Unknown, apart, each_curve,
    propose,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{Knots, shifted_by};

/// A clock rate: the clock of the recorder runs too slow or too fast.
///
/// What happened at the time `t` was recorded at another time, and the difference grows with the time from the start.
///
/// ```text
/// y(t) → y((1 + rate) t)
/// ```
///
/// A clock with a positive rate is too slow: the recorded curves are compressed. Time is counted from `zero`. Between its
/// points a curve is interpolated by a cubic spline, as for `delay`; before its first point and after its last a curve is
/// constant. One clock serves all sensors.
///
/// It is easily confused with every parameter that sets the scale of time, such as a frequency, a stiffness or a wave
/// speed: such a parameter absorbs it where all of the response scales with it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ClockRate {
    /// Prior of the rate, a number from -0.5 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<Distribution>,
    /// Value of the last axis from which the clock counts, in the unit of the axis.
    pub zero: f64,
}

/// The default standard deviation of the rate.
const RATE: f64 = 0.01;

impl CurveEffect for ClockRate {
    const FORM: Form = Form::Linear;

    fn describe(&self) -> Description {
        Description::new(
            "a clock rate: a clock that runs too slow or too fast",
            "y((1 + rate) t)",
            "standard: error of a time base",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        let rate = "{ normal = [0, 0.01] }";
        vec![Unknown::new("rate", "ρ", Measure::Number, &self.rate, rate).within(-0.5, 1.0)]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        if values[0] == 0.0 {
            return response.to_vec();
        }
        let knots = Knots::of(layout);
        let by = |t: f64| -values[0] * (t - self.zero);
        each_curve(layout, response, |y, out| {
            shifted_by(&knots, y, &knots.slopes(y), by, |i, value, _| out[i] = value);
        })
    }

    fn slopes(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let knots = Knots::of(layout);
        let by = |t: f64| -values[0] * (t - self.zero);
        let slopes = each_curve(layout, response, |y, out| {
            shifted_by(&knots, y, &knots.slopes(y), by, |i, _, slope| {
                out[i] = slope * (knots.at[i] - self.zero);
            });
        });
        Matrix::from_vec(response.len(), 1, slopes)
    }

    /// All curves together: they were recorded by one clock.
    fn reach(&self) -> Reach {
        Reach::Whole
    }

    fn sizes(&self, layout: &Layout, _: &Situation<'_>) -> Vec<f64> {
        let Some(span) = Span::of(layout) else { return Vec::new() };
        // Rates whose shifts at the end of the record are half a step apart.
        let step = 0.5 * span.step / span.duration();
        let rates = apart(self.rate.as_ref(), (-0.5, 0.5), step, 40);
        rates.into_iter().filter(|rate| *rate != 0.0).collect()
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        if Span::of_all(situation).is_none() {
            return Vec::new();
        }
        vec![propose(&[("rate", Distribution::Normal([0.0, RATE]))])]
    }
}

lacuna::register!(Effect, "clock_rate", ClockRate);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, largest, uneven};

    /// A sine whose frequency is known, recorded by a clock that is slow by 2 % or fast by 3 %: a sine of another frequency.
    #[test]
    fn a_sine_recorded_by_a_slow_clock_has_a_larger_frequency() {
        let times = uneven(80, 1.0);
        let sine = |t: f64| (t / 3.0).sin();
        let response: Vec<f64> = times.iter().map(|t| sine(*t)).collect();
        let clock = effect("clock_rate", "rate = { normal = [0, 0.1] }");
        for rate in [0.02, -0.03] {
            let found = clock.apply(&curve(times.clone()), &response, &[rate]);
            // Beyond the last point of the response a curve is constant.
            let inside = 0..(times.len() as f64 / (1.0 + f64::max(rate, 0.0))) as usize - 1;
            let worst = largest(&found, &times, inside, |t| sine((1.0 + rate) * t));
            assert!(worst < 5e-3, "{rate}: {worst}");
        }
    }
}
