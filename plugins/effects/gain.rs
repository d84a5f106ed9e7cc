//! `gain`: a wrong gauge factor.

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Situation, Unknown, propose,
};
use lacuna::plugin::{Context, Effect};
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

/// A gain: all values of a curve multiplied by a factor.
///
/// The signal of a sensor is proportional to the measured quantity, but not with the factor of its data sheet, because
/// of the gauge factor, the amplifier, or an adhesive that transmits only a part of the strain.
///
/// ```text
/// y → factor · y
/// ```
///
/// It is easily confused with a source of another strength (which affects all sensors alike), with `damping` on short
/// records, and with `misplacement` of a sensor near a source. A gain of one sensor relative to the others is detected
/// best.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Gain {
    /// Prior of the factor, dimensionless; 1 is no effect, and a negative factor is a sensor with reversed polarity.
    /// Default: mean 1 and standard deviation 0.1, from 0 to 2; data sheets specify some per cent, and bonding can
    /// contribute more.
    pub factor: Distribution,
}

impl Default for Gain {
    fn default() -> Self {
        Self { factor: Distribution::TruncatedNormal([1.0, 0.1, 0.0, 2.0]) }
    }
}

impl CurveEffect for Gain {
    const FORM: Form = Form::Linear;
    const ABSENT: f64 = 1.0;

    fn describe(&self) -> Description {
        Description::new(
            "a gain: a wrong gauge factor",
            "factor · y",
            "standard: sensitivity of a measuring chain",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![Unknown::new("factor", "g", Measure::Number, &self.factor, "{ normal = [1, 0.1] }")]
    }

    fn formula(&self, _: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        response.iter().map(|y| values[0] * y).collect()
    }

    fn slopes(&self, _: &Layout, response: &[f64], _: &[f64]) -> Matrix {
        Matrix::from_vec(response.len(), 1, response.to_vec())
    }

    fn proposals(&self, _: &Situation<'_>) -> Vec<Table> {
        vec![propose(&[("factor", self.factor.clone())])]
    }

    fn check(&self, _: &Context<'_>, _: &mut Complaints<'_>) {}
}

lacuna::register!(Effect, "gain", Gain);
