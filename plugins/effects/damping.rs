//! `damping`: losses that the model leaves out.

use lacuna::data::Layout;
use lacuna::linalg::Matrix;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::{Description, Situation};
use lacuna::plugin::{Component, Context, Effect, Hyperparameter};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{Measure, Span, Unknown, check, each_curve, grid, parameters, propose, signs};

/// Damping: what moves dies away faster than the model says.
///
/// Friction in joints, the material itself, what surrounds the structure.
///
/// ```text
/// y → y · exp(-rate · (t - t0))
/// ```
///
/// with `t0` the first time of the curve: losses before the record are a `gain`. One rate for all frequencies is
/// the damping that is in proportion to the mass; a mode of angular frequency ω and damping ratio ζ has the rate ζ
/// ω.
///
/// It is easily confused with `gain` on short records, with `low_pass` and `gas_attenuation`, which take the fast
/// part first.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Damping {
    /// Prior of the rate, in the inverse unit of the last axis, not below zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<Distribution>,
}

impl Damping {
    fn unknowns(&self) -> [Unknown<'_>; 1] {
        [Unknown {
            name: "rate",
            symbol: "β",
            measure: Measure::PerAxis,
            prior: self.rate.as_ref(),
            limits: (0.0, f64::INFINITY),
            example: "{ half_normal = 500 }",
        }]
    }
}

impl Component for Damping {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        Span::check(context.layout, complaints);
        check(&self.unknowns(), context.layout, complaints);
    }
}

impl Effect for Damping {
    fn describe(&self) -> Description {
        Description {
            title: "damping: losses that the model leaves out".into(),
            formula: "y · exp(-rate · (t - t0))".into(),
            source: "standard: viscous damping, as in Meirovitch, Fundamentals of Vibrations"
                .into(),
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
        let left: Vec<f64> = at.iter().map(|t| (-values[0] * (t - at[0])).exp()).collect();
        response.iter().zip(left.iter().cycle()).map(|(y, left)| y * left).collect()
    }

    fn by_parameters(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let at = grid(layout);
        let after = self.apply(layout, response, values);
        let slopes = each_curve(layout, &after, |y, out| {
            out.iter_mut().zip(y).zip(at).for_each(|((out, y), t)| *out = -(t - at[0]) * y);
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

    fn starts(&self, _: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        signs(self.rate.as_ref(), 0.0).into_iter().map(|rate| vec![rate]).collect()
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
