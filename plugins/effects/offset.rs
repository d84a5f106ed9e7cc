//! `offset`: a wrong zero of the sensor.

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Situation, Unknown, added, added_slopes, propose,
};
use lacuna::plugin::{Context, Effect};
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

/// An offset: a constant added to all values of a curve.
///
/// The zero of the sensor differs from that of the model: the sensor was balanced under load, at another temperature,
/// or not at all.
///
/// ```text
/// y → y + size
/// ```
///
/// It is easily confused with the scatter of the replicates' individual offsets, which it must exceed, with
/// `pulse_heating` (time constant below a time step), and with `level_jumps` near the first time.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Offset {
    /// Prior of the offset, in the unit of the response; either sign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<Distribution>,
}

impl CurveEffect for Offset {
    const FORM: Form = Form::Additive;

    fn describe(&self) -> Description {
        Description::new(
            "an offset: a zero that is not zero",
            "y + size",
            "standard: zero error of a measuring chain",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![Unknown::new("size", "b", Measure::Response, &self.size, "{ normal = [0, 1e-5] }")]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        added(layout, response, values[0], |_| 1.0)
    }

    fn slopes(&self, layout: &Layout, _: &[f64], _: &[f64]) -> Matrix {
        added_slopes(layout, 1, |_, row| row[0] = 1.0)
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let size = 0.1 * situation.scale();
        vec![propose(&[("size", Distribution::Normal([0.0, size]))])]
    }

    fn check(&self, _: &Context<'_>, _: &mut Complaints<'_>) {}
}

lacuna::register!(Effect, "offset", Offset);
