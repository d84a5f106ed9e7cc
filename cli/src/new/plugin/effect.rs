//! `skeleton`: a gain that changes along the curve.

use lacuna::data::Layout;
use lacuna::linalg::Matrix;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::{Description, Situation, curves, each_curve};
use lacuna::plugin::{Component, Context, Effect, Hyperparameter};
use lacuna::study::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

/// A slope of the gain: all values of a curve times a factor that is one in its middle and changes along the last axis.
///
/// An amplifier warms, an adhesive creeps. Where `u` goes from -1 at the first point of a curve to 1 at the last,
///
/// ```text
/// y → (1 + slope · u) · y
/// ```
///
/// It is easily confused with `damping`, whose factor is an exponential, and needs a response that is not
/// near zero at the ends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Skeleton {
    /// Prior of the slope, a number; zero is no effect. By default 10 % from the middle to either end.
    pub slope: Distribution,
}

impl Default for Skeleton {
    fn default() -> Self {
        Self { slope: Distribution::Normal([0.0, 0.1]) }
    }
}

impl Component for Skeleton {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if context.layout.abscissa().is_none() {
            complaints
                .at("use")
                .say("a slope needs curves")
                .expected("a response whose last axis is a grid, such as times");
        }
    }
}

/// Where each value of a curve lies, from -1 to 1; all at zero for a curve of one point.
fn places(at: &[f64]) -> Vec<f64> {
    let [first, last] = [at.first(), at.last()].map(|t| t.copied().unwrap_or(0.0));
    let half = 0.5 * (last - first);
    at.iter().map(|t| if half > 0.0 { (t - first) / half - 1.0 } else { 0.0 }).collect()
}

impl Effect for Skeleton {
    fn describe(&self) -> Description {
        Description {
            title: "a slope of the gain: a sensitivity that changes along the curve".into(),
            formula: "(1 + slope · u) · y".into(),
            source: "standard: sensitivity drift of a measuring chain".into(),
        }
    }

    fn parameters(&self, _: &Layout) -> Vec<Hyperparameter> {
        vec![Hyperparameter {
            name: "slope".into(),
            symbol: "g1".into(),
            unit: lacuna::data::Unit::dimensionless(),
            prior: self.slope.clone(),
            log: false,
            start: self.slope.quantile(0.5),
        }]
    }

    fn absent(&self, _: &Layout) -> Vec<f64> {
        vec![0.0]
    }

    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        each_curve(layout, response, |curve| {
            let factors = places(curve.at).into_iter().map(|u| 1.0 + values[0] * u);
            factors.zip(curve.values).map(|(factor, y)| factor * y).collect()
        })
    }

    fn by_parameters(&self, layout: &Layout, response: &[f64], _: &[f64]) -> Matrix {
        let slopes = curves(layout, response)
            .flat_map(|curve| places(curve.at).into_iter().zip(curve.values).map(|(u, y)| u * y));
        Matrix::from_vec(response.len(), 1, slopes.collect())
    }

    /// It is linear in the response.
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
        let sides = [0.25, 0.75].map(|p| self.slope.quantile(p));
        sides.into_iter().filter(|slope| *slope != 0.0).map(|slope| vec![slope]).collect()
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        // The defaults, where there is a curve at all.
        situation.duration_and_step().map(|_| Table::new()).into_iter().collect()
    }
}

lacuna::register!(Effect, "skeleton", Skeleton);

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::data::{Axis, Unit};

    #[test]
    fn it_keeps_the_contract() {
        assert_eq!(lacuna::contract::effect("skeleton", &Skeleton::default()), Ok(()));
    }

    #[test]
    fn the_ends_of_each_curve_change_and_its_middle_does_not() {
        let times = Axis::grid("time", vec![2.0, 3.0, 4.0], Unit::dimensionless());
        let axes = vec![Axis::labels("sensor", ["A", "B"]), times];
        let layout = Layout { axes, ..Layout::number("y") };
        let response = [1.0, 2.0, 3.0, 4.0, 4.0, 4.0];
        let found = Skeleton::default().apply(&layout, &response, &[0.5]);
        assert_eq!(found, [0.5, 2.0, 4.5, 2.0, 4.0, 6.0]);
    }
}
