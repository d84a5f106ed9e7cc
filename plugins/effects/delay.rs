//! `delay`: a wrong zero of time.

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
    Knots, Measure, Span, Unknown, apart, check, each_curve, parameters, propose, shifted,
};

/// A delay: each curve comes later, or earlier, than it should.
///
/// The clock of the recorder and that of the model do not begin together: trigger, cables, filters of the recorder, a
/// pulse that arrives later than assumed.
///
/// ```text
/// y(t) → y(t - time)
/// ```
///
/// Between its points a curve is a cubic spline; a sine of eight points a period is met within 0.2 %. Before its
/// first point and after its last a curve is at rest, with the first and the last value.
///
/// It is easily confused with `low_pass`, which delays slow signals by its time constant (only what rises fast
/// tells them apart), and with a wrong speed of waves, which delays far sensors more than near ones.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Delay {
    /// Prior of the delay, in the unit of the last axis; below zero the curve comes earlier.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<Distribution>,
}

impl Delay {
    fn unknowns(&self) -> [Unknown<'_>; 1] {
        [Unknown {
            name: "time",
            symbol: "τ",
            measure: Measure::Axis,
            prior: self.time.as_ref(),
            limits: (f64::NEG_INFINITY, f64::INFINITY),
            example: "{ normal = [0, 1e-5] }",
        }]
    }
}

impl Component for Delay {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        Span::check(context.layout, complaints);
        check(&self.unknowns(), context.layout, complaints);
    }
}

impl Effect for Delay {
    fn describe(&self) -> Description {
        Description {
            title: "a delay: a wrong zero of time".into(),
            formula: "y(t - time)".into(),
            source: "standard: trigger and transport delay".into(),
        }
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        parameters(&self.unknowns(), layout)
    }

    fn absent(&self, _: &Layout) -> Vec<f64> {
        vec![0.0]
    }

    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        if values[0] == 0.0 {
            return response.to_vec();
        }
        let knots = Knots::of(layout);
        each_curve(layout, response, |y, out| {
            shifted(&knots, y, &knots.slopes(y), values[0], |i, value, _| out[i] = value);
        })
    }

    fn by_parameters(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let knots = Knots::of(layout);
        let slopes = each_curve(layout, response, |y, out| {
            shifted(&knots, y, &knots.slopes(y), values[0], |i, _, slope| out[i] = -slope);
        });
        Matrix::from_vec(response.len(), 1, slopes)
    }

    fn push_forward(
        &self,
        layout: &Layout,
        _: &[f64],
        values: &[f64],
        tangent: &[f64],
    ) -> Vec<f64> {
        self.apply(layout, tangent, values)
    }

    fn starts(&self, layout: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        let Some(span) = Span::of(layout) else { return Vec::new() };
        let far = 0.9 * span.duration();
        let times = apart(self.time.as_ref(), (-far, far), 0.5 * span.step, 150);
        times.into_iter().filter(|time| *time != 0.0).map(|time| vec![time]).collect()
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
