//! `drift`: a zero that wanders.

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
    signs,
};

/// A drift: a straight line in time added to each curve.
///
/// The sensor warms, charge leaks from an amplifier, a support settles.
///
/// ```text
/// y → y + rate · (t - zero)
/// ```
///
/// The line is zero when the instrument was last set to zero, at the first time of each curve as a rule: then leave `zero`
/// out. With a prior that time is another unknown. The drift is easily confused with `pulse_heating` of a long time constant, and
/// when its zero is not known with an `offset` beside it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Drift {
    /// Prior of the slope, in the unit of the response by that of the last axis, of either sign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<Distribution>,
    /// Prior of the time at which the line is zero, in the unit of the last axis; the first time of each curve when left
    /// out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zero: Option<Distribution>,
}

impl Drift {
    fn unknowns(&self) -> Vec<Unknown<'_>> {
        let mut unknowns = vec![Unknown {
            name: "rate",
            symbol: "r",
            measure: Measure::Rate,
            prior: self.rate.as_ref(),
            limits: (f64::NEG_INFINITY, f64::INFINITY),
            example: "{ normal = [0, 0.01] }",
        }];
        unknowns.extend(self.zero.as_ref().map(|prior| Unknown {
            name: "zero",
            symbol: "t0",
            measure: Measure::Axis,
            prior: Some(prior),
            limits: (f64::NEG_INFINITY, f64::INFINITY),
            example: "{ uniform = [0, 1e-3] }",
        }));
        unknowns
    }
}

/// The time at which the line is zero.
fn zero(at: &[f64], values: &[f64]) -> f64 {
    values.get(1).copied().unwrap_or(at[0])
}

impl Component for Drift {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        Span::check(context.layout, complaints);
        check(&self.unknowns(), context.layout, complaints);
    }
}

impl Effect for Drift {
    fn describe(&self) -> Description {
        Description {
            title: "a drift: a zero that wanders".into(),
            formula: "y + rate · (t - zero)".into(),
            source: "standard: zero drift of a measuring chain".into(),
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
        added(layout, response, values[0], |i| at[i] - zero(at, values))
    }

    fn by_parameters(&self, layout: &Layout, _: &[f64], values: &[f64]) -> Matrix {
        let at = grid(layout);
        added_slopes(layout, values.len(), |i, row| {
            row[0] = at[i] - zero(at, values);
            row[1..].fill(-values[0]);
        })
    }

    fn push_forward(&self, _: &Layout, _: &[f64], _: &[f64], tangent: &[f64]) -> Vec<f64> {
        tangent.to_vec()
    }

    fn starts(&self, layout: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        let rates = signs(self.rate.as_ref(), 0.0);
        match (&self.zero, Span::of(layout)) {
            (Some(prior), Some(span)) => {
                all(&[rates, apart(Some(prior), (span.first, span.last), span.step, 5)])
            }
            _ => rates.into_iter().map(|r| vec![r]).collect(),
        }
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
