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
    Measure, Span, Unknown, added, added_slopes, check, grid, parameters, propose, signs,
};

/// A drift: a straight line in time added to each curve, zero at the mean of its times.
///
/// The sensor warms, charge leaks from an amplifier, a support settles.
///
/// ```text
/// y → y + rate · (t - mean of the times)
/// ```
///
/// As the line is zero in the mean, an `offset` beside it is another matter and the two are not correlated; a drift
/// that begins at zero is both. It is easily confused with `pulse_heating` of a long time constant.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Drift {
    /// Prior of the slope, in the unit of the response by that of the last axis, of either sign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<Distribution>,
}

impl Drift {
    fn unknowns(&self) -> [Unknown<'_>; 1] {
        [Unknown {
            name: "rate",
            symbol: "r",
            measure: Measure::Rate,
            prior: self.rate.as_ref(),
            limits: (f64::NEG_INFINITY, f64::INFINITY),
            example: "{ normal = [0, 0.01] }",
        }]
    }
}

/// The mean of the times of a curve.
fn mean(at: &[f64]) -> f64 {
    at.iter().sum::<f64>() / at.len().max(1) as f64
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
            formula: "y + rate · (t - mean of the times)".into(),
            source: "standard: zero drift of a measuring chain".into(),
        }
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        parameters(&self.unknowns(), layout)
    }

    fn absent(&self, _: &Layout) -> Vec<f64> {
        vec![0.0]
    }

    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let at = grid(layout);
        let middle = mean(at);
        added(layout, response, values[0], |i| at[i] - middle)
    }

    fn by_parameters(&self, layout: &Layout, _: &[f64], _: &[f64]) -> Matrix {
        let at = grid(layout);
        let middle = mean(at);
        added_slopes(layout, 1, |i, row| row[0] = at[i] - middle)
    }

    fn push_forward(&self, _: &Layout, _: &[f64], _: &[f64], tangent: &[f64]) -> Vec<f64> {
        tangent.to_vec()
    }

    fn starts(&self, _: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        signs(self.rate.as_ref(), 0.0).into_iter().map(|r| vec![r]).collect()
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let Some(span) = Span::of_all(situation) else { return Vec::new() };
        let rate = 0.2 * situation.scale() / span.duration();
        vec![propose(&[("rate", Distribution::Normal([0.0, rate]))])]
    }
}

lacuna::register!(Effect, "drift", Drift);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, uneven};

    #[test]
    fn it_is_zero_in_the_mean() {
        let layout = curve(uneven(30, 0.1));
        let found =
            effect("drift", "rate = { normal = [0, 1] }").apply(&layout, &[0.0; 30], &[2.0]);
        assert!(found.iter().sum::<f64>().abs() < 1e-13);
        assert!(((found[29] - found[0]) - 2.0 * (uneven(30, 0.1)[29])).abs() < 1e-13);
    }
}
