//! `secondary_pulse`: a second push.

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
    signs, spaced_by_ratio,
};

/// A secondary pulse: a smooth bump at a later time, in all curves alike.
///
/// Cavities collapse, a valve closes, the source gives a second pulse.
///
/// ```text
/// y → y + amplitude · exp(-(t - time)² / (2 width²))
/// ```
///
/// It is easily confused with `echo` where the signal is one pulse itself, and with `level_jumps` where it ends
/// after the record.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SecondaryPulse {
    /// Prior of the height, in the unit of the response, of either sign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<Distribution>,
    /// Prior of the time of its peak, in the unit of the last axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<Distribution>,
    /// Prior of its width, in the unit of the last axis, above zero: 0.6 of the height is left at this distance
    /// from the peak.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub width: Option<Distribution>,
}

impl SecondaryPulse {
    fn unknowns(&self) -> [Unknown<'_>; 3] {
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
                name: "time",
                symbol: "t2",
                measure: Measure::Axis,
                prior: self.time.as_ref(),
                limits: (f64::NEG_INFINITY, f64::INFINITY),
                example: "{ uniform = [3e-4, 8e-4] }",
            },
            Unknown {
                name: "width",
                symbol: "w",
                measure: Measure::Axis,
                prior: self.width.as_ref(),
                limits: (0.0, f64::INFINITY),
                example: "{ log_uniform = [1e-5, 1e-4] }",
            },
        ]
    }
}

impl Component for SecondaryPulse {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        Span::check(context.layout, complaints);
        check(&self.unknowns(), context.layout, complaints);
    }
}

impl Effect for SecondaryPulse {
    fn describe(&self) -> Description {
        Description {
            title: "a secondary pulse: a second push".into(),
            formula: "y + amplitude · exp(-(t - time)² / (2 width²))".into(),
            source: "standard: a bump of normal shape".into(),
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
        added(layout, response, values[0], |i| {
            let u = (at[i] - values[1]) / values[2];
            (-0.5 * u * u).exp()
        })
    }

    fn by_parameters(&self, layout: &Layout, _: &[f64], values: &[f64]) -> Matrix {
        let at = grid(layout);
        added_slopes(layout, 3, |i, row| {
            let u = (at[i] - values[1]) / values[2];
            row[0] = (-0.5 * u * u).exp();
            row[1] = values[0] * row[0] * u / values[2];
            row[2] = row[1] * u;
        })
    }

    fn push_forward(&self, _: &Layout, _: &[f64], _: &[f64], tangent: &[f64]) -> Vec<f64> {
        tangent.to_vec()
    }

    fn starts(&self, layout: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        let Some(span) = Span::of(layout) else { return Vec::new() };
        let range = (0.5 * span.step, 0.3 * span.duration());
        let widths = spaced_by_ratio(self.width.as_ref(), range, 2);
        let times = apart(self.time.as_ref(), (span.first, span.last), widths[0], 45);
        all(&[signs(self.amplitude.as_ref(), 0.0), times, widths])
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let Some(span) = Span::of_all(situation) else { return Vec::new() };
        vec![propose(&[
            ("amplitude", Distribution::Normal([0.0, 0.2 * situation.scale()])),
            ("time", Distribution::Uniform([span.first, span.last])),
            ("width", Distribution::LogUniform([0.7 * span.step, span.share(0.15)])),
        ])]
    }
}

lacuna::register!(Effect, "secondary_pulse", SecondaryPulse);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, even};

    /// The area of a normal curve is `sqrt(2 π)` times height and width.
    #[test]
    fn the_bump_has_the_area_of_a_normal_curve() {
        let options = "amplitude = { normal = [0, 1] }\ntime = { uniform = [0, 50] }\n\
                       width = { half_normal = 1 }";
        let pulse = effect("secondary_pulse", options);
        let found = pulse.apply(&curve(even(51, 1.0)), &[0.0; 51], &[-2.0, 24.3, 3.0]);
        let area = -6.0 * std::f64::consts::TAU.sqrt();
        assert!((found.iter().sum::<f64>() - area).abs() < 1e-9);
    }
}
