//! `gas_attenuation`: attenuation of a part of the signal by gas bubbles.

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::Effect;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Reach, Situation, Span, Unknown, each_curve, grid,
    propose, spaced_by_ratio,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{Filter, Knots};

/// Gas attenuation: a fraction of the signal loses its high frequencies, like waves in a bubbly liquid.
///
/// ```text
/// y → (1 - share) · y + share · z,     relaxation_time · z'(t) = y(t) - z(t)
/// ```
///
/// Bubbles follow slow changes of pressure and attenuate fast ones. In the mercury target of the SNS gas reduces the
/// strain by 25 to 75 % (Materials & Design (2022) 110937). The effect describes the change at a sensor, not the
/// mechanism: for that, replace the model (`mercury_target_equilibrium_gas`). The lag is solved as in `low_pass`.
///
/// It is easily confused with `gain` (relaxation time far above the length of the record), with `low_pass` (fraction of
/// one) and with `damping`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GasAttenuation {
    /// Prior of the attenuated fraction of the signal, from 0 to 1. Default: uniform.
    pub share: Distribution,
    /// Prior of the relaxation time, in the unit of the last axis, zero or positive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relaxation_time: Option<Distribution>,
}

impl Default for GasAttenuation {
    fn default() -> Self {
        Self { share: Distribution::Uniform([0.0, 1.0]), relaxation_time: None }
    }
}

/// Response after a first-order lag with the time constant `time`.
fn lagged(layout: &Layout, response: &[f64], time: f64) -> Vec<f64> {
    let Some(filter) = Filter::new(grid(layout), time) else { return response.to_vec() };
    let knots = Knots::of(layout);
    each_curve(layout, response, |y, out| filter.answer(&knots, y, out))
}

impl CurveEffect for GasAttenuation {
    const FORM: Form = Form::Linear;

    fn describe(&self) -> Description {
        Description::new(
            "gas attenuation: a part of the signal passes through gas",
            "(1 - share) · y + share · z with relaxation_time · z' = y - z",
            "standard: relaxation; the share by McClintock et al., Materials & Design (2022) 110937",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![
            Unknown::new("share", "A", Measure::Number, &self.share, "{ uniform = [0, 1] }")
                .within(0.0, 1.0),
            Unknown::new(
                "relaxation_time",
                "τ",
                Measure::Axis,
                &self.relaxation_time,
                "{ log_uniform = [1e-6, 1e-4] }",
            )
            .not_negative(),
        ]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let filtered = lagged(layout, response, values[1]);
        let mix = |(y, z): (&f64, f64)| (1.0 - values[0]) * y + values[0] * z;
        response.iter().zip(filtered).map(mix).collect()
    }

    fn slopes(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let filtered = lagged(layout, response, values[1]);
        let slopes = Filter::slopes(layout, values[1], response, &filtered);
        Matrix::from_fn(response.len(), 2, |i, j| match j {
            0 => filtered[i] - response[i],
            _ => values[0] * slopes[i],
        })
    }

    /// All curves together, since the gas lies between the source and every sensor.
    fn reach(&self) -> Reach {
        Reach::Whole
    }

    fn indices(&self, layout: &Layout) -> Option<Vec<Vec<f64>>> {
        let range = Span::of(layout).map_or((1e-3, 1.0), |s| (0.2 * s.step, s.duration()));
        Some(vec![spaced_by_ratio(self.relaxation_time.as_ref(), range, 12)])
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let Some(span) = Span::of_all(situation) else { return Vec::new() };
        let time = Distribution::LogUniform([0.3 * span.step, span.share(0.3)]);
        vec![propose(&[("share", self.share.clone()), ("relaxation_time", time)])]
    }
}

lacuna::register!(Effect, "gas_attenuation", GasAttenuation);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, even, largest};

    /// `T z' = exp(-k t) - z` from `z = 1` has `z = (exp(-k t) - k T exp(-t / T)) / (1 - k T)`.
    #[test]
    fn an_exponential_is_attenuated_as_the_equation_says() {
        let times = even(100, 0.1);
        let response: Vec<f64> = times.iter().map(|t| (-0.5 * t).exp()).collect();
        let gas = effect("gas_attenuation", "relaxation_time = { half_normal = 1 }");
        let found = gas.apply(&curve(times.clone()), &response, &[0.4, 0.7]);
        let lag = |t: f64| ((-0.5 * t).exp() - 0.35 * (-t / 0.7).exp()) / 0.65;
        let error = largest(&found, &times, 0..100, |t| 0.6 * (-0.5 * t).exp() + 0.4 * lag(t));
        assert!(error < 1e-7, "{error}");
    }
}
