//! `damping`: losses that the model omits.

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::Effect;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Situation, Span, Unknown, each_curve, grid, propose,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

/// Damping: motion decays faster than the model predicts.
///
/// Typical causes: friction in joints, internal friction of the material, the surrounding medium.
///
/// ```text
/// y → y · exp(-rate · (t - t0))
/// ```
///
/// with `t0` the first time of the curve; losses before the record act as a `gain`. One rate for all frequencies
/// corresponds to mass-proportional damping; a mode of angular frequency ω and damping ratio ζ decays at the rate ζ ω.
///
/// It is easily confused with `gain` on short records, and with `low_pass` and `gas_attenuation`, which attenuate high
/// frequencies first.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Damping {
    /// Prior of the decay rate, in the inverse unit of the last axis, zero or positive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<Distribution>,
}

impl CurveEffect for Damping {
    const FORM: Form = Form::Linear;

    fn describe(&self) -> Description {
        Description::new(
            "damping: losses that the model leaves out",
            "y · exp(-rate · (t - t0))",
            "standard: viscous damping, as in Meirovitch, Fundamentals of Vibrations",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![
            Unknown::new("rate", "β", Measure::PerAxis, &self.rate, "{ half_normal = 500 }")
                .not_negative(),
        ]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let at = grid(layout);
        let left: Vec<f64> = at.iter().map(|t| (-values[0] * (t - at[0])).exp()).collect();
        response.iter().zip(left.iter().cycle()).map(|(y, left)| y * left).collect()
    }

    fn slopes(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let at = grid(layout);
        let after = self.formula(layout, response, values);
        let slopes = each_curve(layout, &after, |y, out| {
            out.iter_mut().zip(y).zip(at).for_each(|((out, y), t)| *out = -(t - at[0]) * y);
        });
        Matrix::from_vec(response.len(), 1, slopes)
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let Some(span) = Span::of_all(situation) else { return Vec::new() };
        vec![propose(&[("rate", Distribution::HalfNormal(0.5 / span.duration()))])]
    }
}

lacuna::register!(Effect, "damping", Damping);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, even, largest};

    /// Losses in sequence add their rates.
    #[test]
    fn rates_add_and_the_first_value_stays() {
        let times: Vec<f64> = even(20, 0.1).iter().map(|t| t + 5.0).collect();
        let damping = effect("damping", "rate = { half_normal = 1 }");
        let layout = curve(times.clone());
        let once = damping.apply(&layout, &[2.0; 20], &[0.7]);
        let twice = damping.apply(&layout, &once, &[0.4]);
        assert!(largest(&twice, &times, 0..20, |t| 2.0 * (-1.1 * (t - 5.0)).exp()) < 1e-14);
    }
}
