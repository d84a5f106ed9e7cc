//! `drift`: a linear drift of the zero.

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::Effect;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Situation, Span, Unknown, added, added_slopes, apart,
    grid, propose,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

/// A drift: a straight line in time added to each curve.
///
/// Typical causes: a sensor warming up, charge leaking from an amplifier, a settling support.
///
/// ```text
/// y → y + rate · (t - zero)
/// ```
///
/// The line is zero at the time at which the instrument was last balanced, usually the first time of each curve; `zero`
/// is then omitted. With a prior, that time is a further unknown. The drift is easily confused with `pulse_heating` of
/// a long time constant and, if its zero is unknown, with an additional `offset`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Drift {
    /// Prior of the slope, in the unit of the response per unit of the last axis; either sign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<Distribution>,
    /// Prior of the time at which the line is zero, in the unit of the last axis. Default: the first time of each
    /// curve, not an unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zero: Option<Distribution>,
}

/// Time at which the line is zero: the second unknown or, without it, the first time.
fn zero(at: &[f64], values: &[f64]) -> f64 {
    values.get(1).copied().unwrap_or(at[0])
}

impl CurveEffect for Drift {
    const FORM: Form = Form::Additive;

    fn describe(&self) -> Description {
        Description::new(
            "a drift: a zero that wanders",
            "y + rate · (t - zero)",
            "standard: zero drift of a measuring chain",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        let mut unknowns =
            vec![Unknown::new("rate", "r", Measure::Rate, &self.rate, "{ normal = [0, 0.01] }")];
        unknowns.extend(self.zero.as_ref().map(|prior| {
            Unknown::new("zero", "t0", Measure::Axis, prior, "{ uniform = [0, 1e-3] }")
        }));
        unknowns
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let at = grid(layout);
        added(layout, response, values[0], |i| at[i] - zero(at, values))
    }

    fn slopes(&self, layout: &Layout, _: &[f64], values: &[f64]) -> Matrix {
        let at = grid(layout);
        added_slopes(layout, values.len(), |i, row| {
            row[0] = at[i] - zero(at, values);
            row[1..].fill(-values[0]);
        })
    }

    fn indices(&self, layout: &Layout) -> Option<Vec<Vec<f64>>> {
        let Some(prior) = &self.zero else { return Some(Vec::new()) };
        let span = Span::of(layout)?;
        Some(vec![apart(Some(prior), (span.first, span.last), span.step, 5)])
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let Some(span) = Span::of_all(situation) else { return Vec::new() };
        let rate = 0.2 * situation.scale() / span.duration();
        let rate = Distribution::Normal([0.0, rate]);
        let zero = Distribution::Uniform([span.first, span.last]);
        vec![propose(&[("rate", rate.clone())]), propose(&[("rate", rate), ("zero", zero)])]
    }
}

lacuna::register!(Effect, "drift", Drift);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, uneven};

    #[test]
    fn it_is_zero_at_the_first_time_or_where_it_is_told() {
        let at = uneven(30, 0.1);
        let layout = curve(at.clone());
        let plain = effect("drift", "rate = { normal = [0, 1] }");
        let found = plain.apply(&layout, &[0.0; 30], &[2.0]);
        assert!(found.iter().zip(&at).all(|(y, t)| (y - 2.0 * (t - at[0])).abs() < 1e-13));
        let options = "rate = { normal = [0, 1] }\nzero = { uniform = [0, 3] }";
        let found = effect("drift", options).apply(&layout, &[0.0; 30], &[2.0, at[7]]);
        assert!(found[7].abs() < 1e-13 && found[8] > 0.0);
    }
}
