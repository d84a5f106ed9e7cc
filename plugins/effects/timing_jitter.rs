//! `timing_jitter`: replicates that begin at random.

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
    Knots, Measure, Span, Unknown, check, each_curve, parameters, propose, shifted, signs,
};

/// Jitter of the timing: replicates begin at random, and their mean is a blurred curve.
///
/// Each replicate has a delay of its own, normal about zero with the standard deviation `deviation`. What they have
/// in common is then the mean over the delays, with every fast change rounded off; a sine of angular frequency ω
/// shrinks by `exp(-ω² deviation² / 2)`.
///
/// ```text
/// y(t) → mean of y(t - deviation · z) over normal z
/// ```
///
/// The mean is a sum over fifteen delays. Curves are splines between their points, and at rest before the first and
/// after the last. Around zero the change is of second order: a small jitter cannot be seen.
///
/// It is easily confused with `low_pass`, which delays as well, with `gauge_length`, and with noise that is larger
/// where the curve is steep, which jitter also makes.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TimingJitter {
    /// Prior of the standard deviation of the delays, in the unit of the last axis, not below zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deviation: Option<Distribution>,
}

impl TimingJitter {
    fn unknowns(&self) -> [Unknown<'_>; 1] {
        [Unknown {
            name: "deviation",
            symbol: "σ",
            measure: Measure::Axis,
            prior: self.deviation.as_ref(),
            limits: (0.0, f64::INFINITY),
            example: "{ half_normal = 1e-5 }",
        }]
    }
}

/// Nodes and weights of a mean over the standard normal law: the trapezoidal rule, whose error for smooth functions
/// is that of its ends, 2e-7 (Trefethen and Weideman, SIAM Review 56 (2014) 385).
fn nodes() -> impl Iterator<Item = (f64, f64)> {
    let node = |k: i32| 0.75 * f64::from(k);
    let density = |z: f64| (-0.5 * z * z).exp();
    let total: f64 = (-7..=7).map(|k| density(node(k))).sum();
    (-7..=7).map(move |k| (node(k), density(node(k)) / total))
}

impl Component for TimingJitter {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        Span::check(context.layout, complaints);
        check(&self.unknowns(), context.layout, complaints);
    }
}

impl Effect for TimingJitter {
    fn describe(&self) -> Description {
        Description {
            title: "jitter of the timing: replicates that begin at random".into(),
            formula: "mean of y(t - deviation · z) over normal z".into(),
            source: "standard: mean of signals with jitter, which passes exp(-ω² deviation² / 2)"
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
        if values[0] == 0.0 {
            return response.to_vec();
        }
        let knots = Knots::of(layout);
        each_curve(layout, response, |y, out| {
            let slopes = knots.slopes(y);
            for (z, weight) in nodes() {
                let add = |i: usize, value: f64, _: f64| out[i] += weight * value;
                shifted(&knots, y, &slopes, values[0] * z, add);
            }
        })
    }

    fn by_parameters(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let knots = Knots::of(layout);
        let by_deviation = each_curve(layout, response, |y, out| {
            let slopes = knots.slopes(y);
            for (z, weight) in nodes() {
                let add = |i: usize, _: f64, slope: f64| out[i] -= weight * z * slope;
                shifted(&knots, y, &slopes, values[0] * z, add);
            }
        });
        Matrix::from_vec(response.len(), 1, by_deviation)
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
        signs(self.deviation.as_ref(), 0.0).into_iter().map(|s| vec![s]).collect()
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let Some(span) = Span::of_all(situation) else { return Vec::new() };
        vec![propose(&[("deviation", Distribution::HalfNormal(span.share(0.01)))])]
    }
}

lacuna::register!(Effect, "timing_jitter", TimingJitter);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, even, largest};

    #[test]
    fn a_sine_shrinks_as_the_mean_over_normal_phases_says() {
        let times = even(400, 1.0);
        let omega = std::f64::consts::TAU / 20.0;
        let response: Vec<f64> = times.iter().map(|t| (omega * t).sin()).collect();
        let jitter = effect("timing_jitter", "deviation = { half_normal = 1 }");
        for sigma in [0.3, 2.0, 5.0] {
            let found = jitter.apply(&curve(times.clone()), &response, &[sigma]);
            let left = (-0.5 * (omega * sigma).powi(2)).exp();
            let error = largest(&found, &times, 40..360, |t| left * (omega * t).sin());
            assert!(error < 1e-4, "{sigma}: {error}");
        }
    }
}
