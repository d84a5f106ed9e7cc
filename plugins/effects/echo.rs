//! `echo`: a reflection that the model leaves out.

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
    Knots, Measure, Span, Unknown, all, apart, check, each_curve, parameters, propose, shifted,
    signs,
};

/// An echo: the signal arrives a second time, later and weaker, or upside down.
///
/// A wave is reflected at a boundary that the model takes for open, or takes another way in the structure. A free
/// end returns strain with the other sign, a fixed end with the same.
///
/// ```text
/// y(t) → y(t) + strength · (y(t - lag) - y(t0))
/// ```
///
/// The first value of the curve, at `t0`, is that of rest, so that nothing arrives before the lag. Between its
/// points a curve is a spline.
///
/// It is easily confused with `resonance` where the signal rings itself, with `secondary_pulse`, and with
/// `low_pass` for lags of a few steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Echo {
    /// Prior of the strength, from -1 to 1: an echo is not louder than the call. By default 0.2 about zero: steel
    /// against mercury reflects 0.4 of a pressure wave, and most ways back lose more.
    pub strength: Distribution,
    /// Prior of the time after which it arrives, in the unit of the last axis, not below zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lag: Option<Distribution>,
}

impl Default for Echo {
    fn default() -> Self {
        Self { strength: Distribution::TruncatedNormal([0.0, 0.2, -1.0, 1.0]), lag: None }
    }
}

impl Echo {
    fn unknowns(&self) -> [Unknown<'_>; 2] {
        [
            Unknown {
                name: "strength",
                symbol: "a",
                measure: Measure::Number,
                prior: Some(&self.strength),
                limits: (-1.0, 1.0),
                example: "{ uniform = [-1, 1] }",
            },
            Unknown {
                name: "lag",
                symbol: "τ",
                measure: Measure::Axis,
                prior: self.lag.as_ref(),
                limits: (0.0, f64::INFINITY),
                example: "{ uniform = [1e-5, 8e-4] }",
            },
        ]
    }
}

impl Component for Echo {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        Span::check(context.layout, complaints);
        check(&self.unknowns(), context.layout, complaints);
    }
}

impl Effect for Echo {
    fn describe(&self) -> Description {
        Description {
            title: "an echo: a reflection that the model leaves out".into(),
            formula: "y(t) + strength · (y(t - lag) - y(t0))".into(),
            source: "standard: reflection at a boundary".into(),
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
        let knots = Knots::of(layout);
        each_curve(layout, response, |y, out| {
            shifted(&knots, y, &knots.slopes(y), values[1], |i, late, _| {
                out[i] = y[i] + values[0] * (late - y[0]);
            });
        })
    }

    fn by_parameters(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
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
        let range = (0.5 * span.step, span.duration() - 0.5 * span.step);
        let lags = apart(self.lag.as_ref(), range, span.step, 90);
        all(&[signs(Some(&self.strength), 0.0), lags])
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
