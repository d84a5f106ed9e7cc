//! `secondary_pulse`: a later pulse of the excitation.

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::Effect;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Situation, Span, Unknown, added, added_slopes, apart,
    grid, propose, spaced_by_ratio,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

/// A secondary pulse: a Gaussian pulse at a later time, added to all curves alike.
///
/// Typical causes: collapsing cavities, a closing valve, a second pulse of the source.
///
/// ```text
/// y → y + amplitude · exp(-(t - time)² / (2 width²))
/// ```
///
/// It is easily confused with `echo` if the signal itself is a single pulse, and with `level_jumps` if it ends after
/// the record.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SecondaryPulse {
    /// Prior of the peak height, in the unit of the response; either sign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<Distribution>,
    /// Prior of the time of the peak, in the unit of the last axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<Distribution>,
    /// Prior of the width (standard deviation of the Gaussian), in the unit of the last axis, above zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub width: Option<Distribution>,
}

impl CurveEffect for SecondaryPulse {
    const FORM: Form = Form::Additive;

    fn describe(&self) -> Description {
        Description::new(
            "a secondary pulse: a second push",
            "y + amplitude · exp(-(t - time)² / (2 width²))",
            "standard: a bump of normal shape",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![
            Unknown::new(
                "amplitude",
                "A",
                Measure::Response,
                &self.amplitude,
                "{ normal = [0, 1e-4] }",
            ),
            Unknown::new("time", "t2", Measure::Axis, &self.time, "{ uniform = [3e-4, 8e-4] }"),
            Unknown::new(
                "width",
                "w",
                Measure::Axis,
                &self.width,
                "{ log_uniform = [1e-5, 1e-4] }",
            )
            .not_negative(),
        ]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let at = grid(layout);
        added(layout, response, values[0], |i| {
            let u = (at[i] - values[1]) / values[2];
            (-0.5 * u * u).exp()
        })
    }

    fn slopes(&self, layout: &Layout, _: &[f64], values: &[f64]) -> Matrix {
        let at = grid(layout);
        added_slopes(layout, 3, |i, row| {
            let u = (at[i] - values[1]) / values[2];
            row[0] = (-0.5 * u * u).exp();
            row[1] = values[0] * row[0] * u / values[2];
            row[2] = row[1] * u;
        })
    }

    fn indices(&self, layout: &Layout) -> Option<Vec<Vec<f64>>> {
        let span = Span::of(layout)?;
        let range = (0.5 * span.step, 0.3 * span.duration());
        let widths = spaced_by_ratio(self.width.as_ref(), range, 2);
        let times = apart(self.time.as_ref(), (span.first, span.last), widths[0], 45);
        Some(vec![times, widths])
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
