//! `gain`: a wrong gauge factor.

use lacuna::data::Layout;
use lacuna::linalg::Matrix;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::{Description, Situation};
use lacuna::plugin::{Component, Context, Effect, Hyperparameter};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{Measure, Unknown, check, parameters, propose, signs};

/// A gain: all values of a curve times one number.
///
/// What a sensor shows is in proportion to what happens, but not by the factor of its data sheet: the gauge factor,
/// the amplifier, an adhesive that passes on only a part of the strain.
///
/// ```text
/// y → factor · y
/// ```
///
/// It is easily confused with a source of another strength (all sensors alike), with `damping` on short records, and
/// at a sensor near a source with `misplacement`. A gain of one sensor against the others is seen best.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Gain {
    /// Prior of the factor, a number; one is no effect, and one below zero is a sensor with its poles exchanged. By
    /// default 10 % about one: data sheets promise some per cent, bonding can cost more.
    pub factor: Distribution,
}

impl Default for Gain {
    fn default() -> Self {
        Self { factor: Distribution::TruncatedNormal([1.0, 0.1, 0.0, 2.0]) }
    }
}

impl Gain {
    fn unknowns(&self) -> [Unknown<'_>; 1] {
        [Unknown {
            name: "factor",
            symbol: "g",
            measure: Measure::Number,
            prior: Some(&self.factor),
            limits: (f64::NEG_INFINITY, f64::INFINITY),
            example: "{ normal = [1, 0.1] }",
        }]
    }
}

impl Component for Gain {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        check(&self.unknowns(), context.layout, complaints);
    }
}

impl Effect for Gain {
    fn describe(&self) -> Description {
        Description {
            title: "a gain: a wrong gauge factor".into(),
            formula: "factor · y".into(),
            source: "standard: sensitivity of a measuring chain".into(),
        }
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        parameters(&self.unknowns(), layout)
    }

    fn absent(&self, _: &Layout) -> Vec<f64> {
        vec![1.0]
    }

    fn apply(&self, _: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        response.iter().map(|y| values[0] * y).collect()
    }

    fn by_parameters(&self, _: &Layout, response: &[f64], _: &[f64]) -> Matrix {
        Matrix::from_vec(response.len(), 1, response.to_vec())
    }

    fn push_forward(&self, _: &Layout, _: &[f64], values: &[f64], tangent: &[f64]) -> Vec<f64> {
        tangent.iter().map(|v| values[0] * v).collect()
    }

    fn starts(&self, _: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        signs(Some(&self.factor), 1.0).into_iter().map(|g| vec![g]).collect()
    }

    fn proposals(&self, _: &Situation<'_>) -> Vec<Table> {
        vec![propose(&[("factor", self.factor.clone())])]
    }
}

lacuna::register!(Effect, "gain", Gain);
