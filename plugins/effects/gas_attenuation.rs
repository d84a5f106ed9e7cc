//! `gas_attenuation`: a part of the signal that passes through gas.

use lacuna::data::Layout;
use lacuna::linalg::Matrix;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::{Description, Reach, Situation};
use lacuna::plugin::{Component, Context, Effect, Hyperparameter};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{
    Filter, Knots, Measure, Span, Unknown, all, check, each_curve, grid, parameters, propose,
    signs, spaced_by_ratio,
};

/// Gas attenuation: a share of the signal loses its fast part, as waves do in a liquid with bubbles.
///
/// ```text
/// y → (1 - share) · y + share · z,     relaxation_time · z'(t) = y(t) - z(t)
/// ```
///
/// Bubbles give way to slow pressure and take the fast part of it. In the mercury target of the SNS gas takes 25 to
/// 75 % of the strain (Materials & Design (2022) 110937); this is how it looks at a sensor, not how it comes about: for
/// that swap the model (`mercury_target_equilibrium_gas`). The lag is solved as in `low_pass`.
///
/// It is easily confused with `gain` (relaxation time far above the record), with `low_pass` (share of one) and
/// `damping`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GasAttenuation {
    /// Prior of the share that is attenuated, from 0 to 1; by default any is as likely.
    pub share: Distribution,
    /// Prior of the relaxation time, in the unit of the last axis, not below zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relaxation_time: Option<Distribution>,
}

impl Default for GasAttenuation {
    fn default() -> Self {
        Self { share: Distribution::Uniform([0.0, 1.0]), relaxation_time: None }
    }
}

impl GasAttenuation {
    fn unknowns(&self) -> [Unknown<'_>; 2] {
        [
            Unknown {
                name: "share",
                symbol: "A",
                measure: Measure::Number,
                prior: Some(&self.share),
                limits: (0.0, 1.0),
                example: "{ uniform = [0, 1] }",
            },
            Unknown {
                name: "relaxation_time",
                symbol: "τ",
                measure: Measure::Axis,
                prior: self.relaxation_time.as_ref(),
                limits: (0.0, f64::INFINITY),
                example: "{ log_uniform = [1e-6, 1e-4] }",
            },
        ]
    }
}

/// What a first-order lag makes of a response.
fn lagged(layout: &Layout, response: &[f64], time: f64) -> Vec<f64> {
    let Some(filter) = Filter::new(grid(layout), time) else { return response.to_vec() };
    let knots = Knots::of(layout);
    each_curve(layout, response, |y, out| filter.answer(&knots, y, out))
}

impl Component for GasAttenuation {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        Span::check(context.layout, complaints);
        check(&self.unknowns(), context.layout, complaints);
    }
}

impl Effect for GasAttenuation {
    fn describe(&self) -> Description {
        Description {
            title: "gas attenuation: a part of the signal passes through gas".into(),
            formula: "(1 - share) · y + share · z with relaxation_time · z' = y - z".into(),
            source: "standard: relaxation; the share by McClintock et al., Materials & Design (2022) 110937".into(),
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
        let filtered = lagged(layout, response, values[1]);
        let mix = |(y, z): (&f64, f64)| (1.0 - values[0]) * y + values[0] * z;
        response.iter().zip(filtered).map(mix).collect()
    }

    fn by_parameters(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let filtered = lagged(layout, response, values[1]);
        let slopes = Filter::slopes(layout, values[1], response, &filtered);
        Matrix::from_fn(response.len(), 2, |i, j| match j {
            0 => filtered[i] - response[i],
            _ => values[0] * slopes[i],
        })
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

    /// Gas in the liquid is between the source and every sensor.
    fn reach(&self) -> Reach {
        Reach::Whole
    }

    fn starts(&self, layout: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        let range = Span::of(layout).map_or((1e-3, 1.0), |s| (0.2 * s.step, s.duration()));
        let times = spaced_by_ratio(self.relaxation_time.as_ref(), range, 12);
        all(&[signs(Some(&self.share), 0.0), times])
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
