//! `echo`: a reflection that the model omits.

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

/// An echo: the signal arrives a second time, delayed and attenuated, possibly with the opposite sign.
///
/// A wave is reflected at a boundary that the model treats as open, or travels along a second path in the structure. A
/// free end reflects strain with the opposite sign, a fixed end with the same sign.
///
/// ```text
/// y(t) → y(t) + strength · (y(t - lag) - y(t0))
/// ```
///
/// The first value of the curve, at `t0`, is the state of rest, so that nothing arrives before the lag. Between its
/// points a curve is interpolated by a spline.
///
/// It is easily confused with `resonance` if the signal itself oscillates, with `secondary_pulse`, and with `low_pass`
/// for lags of a few time steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Echo {
    /// Prior of the strength (reflected over incident amplitude), from -1 to 1. Default: mean 0, scale 0.2; an
    /// interface between steel and mercury reflects 0.4 of a pressure wave, and most paths lose more.
    pub strength: Distribution,
    /// Prior of the lag, in the unit of the last axis, zero or positive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lag: Option<Distribution>,
}

impl Default for Echo {
    fn default() -> Self {
        Self { strength: Distribution::TruncatedNormal([0.0, 0.2, -1.0, 1.0]), lag: None }
    }
}

impl CurveEffect for Echo {
    const FORM: Form = Form::Linear;

    fn describe(&self) -> Description {
        Description::new(
            "an echo: a reflection that the model leaves out",
            "y(t) + strength · (y(t - lag) - y(t0))",
            "standard: reflection at a boundary",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![
            Unknown::new("strength", "a", Measure::Number, &self.strength, "{ uniform = [-1, 1] }")
                .within(-1.0, 1.0),
            Unknown::new("lag", "τ", Measure::Axis, &self.lag, "{ uniform = [1e-5, 8e-4] }")
                .not_negative(),
        ]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let knots = Knots::of(layout);
        each_curve(layout, response, |y, out| {
            shifted(&knots, y, &knots.slopes(y), values[1], |i, late, _| {
                out[i] = y[i] + values[0] * (late - y[0]);
            });
        })
    }

    fn slopes(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let knots = Knots::of(layout);
        let mut both = Matrix::zeros(response.len(), 2);
        let mut rows = both.as_mut_slice().chunks_mut(2 * knots.at.len());
        for y in response.chunks(knots.at.len()) {
            let Some(rows) = rows.next() else { break };
            shifted(&knots, y, &knots.slopes(y), values[1], |i, late, slope| {
                rows[2 * i] = late - y[0];
                rows[2 * i + 1] = -values[0] * slope;
            });
        }
        both
    }

    fn indices(&self, layout: &Layout) -> Option<Vec<Vec<f64>>> {
        let span = Span::of(layout)?;
        let range = (0.5 * span.step, span.duration() - 0.5 * span.step);
        Some(vec![apart(self.lag.as_ref(), range, span.step, 90)])
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let Some(span) = Span::of_all(situation) else { return Vec::new() };
        let lag =
            Distribution::Uniform([span.step.min(0.1 * span.duration()), 0.8 * span.duration()]);
        vec![propose(&[("strength", self.strength.clone()), ("lag", lag)])]
    }
}

lacuna::register!(Effect, "echo", Echo);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, even, largest};

    /// From the lag on `exp(-t) + a (exp(-(t - lag)) - 1)`.
    #[test]
    fn an_exponential_comes_back_as_an_exponential() {
        let times = even(80, 0.05);
        let response: Vec<f64> = times.iter().map(|t| (-t).exp()).collect();
        let echo = effect("echo", "lag = { uniform = [0, 4] }");
        let found = echo.apply(&curve(times.clone()), &response, &[-0.3, 1.23]);
        let late = |t: f64| if t < 1.23 { 0.0 } else { (1.23 - t).exp() - 1.0 };
        let error = largest(&found, &times, 0..80, |t| (-t).exp() - 0.3 * late(t));
        assert!(error < 1e-6, "{error}");
    }
}
