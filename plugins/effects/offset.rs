//! `offset`: a zero that is not zero.

use lacuna::data::Layout;
use lacuna::linalg::Matrix;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::{Description, Situation};
use lacuna::plugin::{Component, Context, Effect, Hyperparameter};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{Measure, Unknown, added, added_slopes, check, parameters, propose, signs};

/// An offset: the same number added to all values of a curve.
///
/// The zero of the sensor is not that of the model: it was balanced under load, at another temperature, or not at
/// all.
///
/// ```text
/// y → y + size
/// ```
///
/// It is easily confused with the scatter of the replicates' own offsets, which it must exceed, with
/// `pulse_heating` of a time constant below a step, and with `level_jumps` at the first times.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Offset {
    /// Prior of the offset, in the unit of the response, of either sign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<Distribution>,
}

impl Offset {
    fn unknowns(&self) -> [Unknown<'_>; 1] {
        [Unknown {
            name: "size",
            symbol: "b",
            measure: Measure::Response,
            prior: self.size.as_ref(),
            limits: (f64::NEG_INFINITY, f64::INFINITY),
            example: "{ normal = [0, 1e-5] }",
        }]
    }
}

impl Component for Offset {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        check(&self.unknowns(), context.layout, complaints);
    }
}

impl Effect for Offset {
    fn describe(&self) -> Description {
        Description {
            title: "an offset: a zero that is not zero".into(),
            formula: "y + size".into(),
            source: "standard: zero error of a measuring chain".into(),
        }
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        parameters(&self.unknowns(), layout)
    }

    fn absent(&self, _: &Layout) -> Vec<f64> {
        vec![0.0]
    }

    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        added(layout, response, values[0], |_| 1.0)
    }

    fn by_parameters(&self, layout: &Layout, _: &[f64], _: &[f64]) -> Matrix {
        added_slopes(layout, 1, |_, row| row[0] = 1.0)
    }

    fn push_forward(&self, _: &Layout, _: &[f64], _: &[f64], tangent: &[f64]) -> Vec<f64> {
        tangent.to_vec()
    }

    fn starts(&self, _: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        signs(self.size.as_ref(), 0.0).into_iter().map(|b| vec![b]).collect()
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let size = 0.1 * situation.scale();
        vec![propose(&[("size", Distribution::Normal([0.0, size]))])]
    }
}

lacuna::register!(Effect, "offset", Offset);
