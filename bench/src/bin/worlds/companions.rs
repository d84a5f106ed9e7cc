//! Companions of the worlds as model plugins of this program: `companion_box` and `companion_pipe`.

use std::fmt::Write as _;

use generator::mercury_box::MercuryBox;
use generator::pipe::Pipe;
use generator::{companion_box, companion_pipe};
use lacuna::data::Unit;
use lacuna::plugin::model::{Call, EvalError, Input, Response, Signature};
use lacuna::plugin::{Component, Context, Model};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::studied::Accompanied;

/// The companion of the box.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CompanionBox {}

/// The companion of the pipe.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CompanionPipe {}

impl Component for CompanionBox {}
impl Component for CompanionPipe {}

impl Model for CompanionBox {
    fn signature(&self, context: &Context<'_>) -> Signature {
        signature(&companion_box::INPUTS, context)
    }

    fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError> {
        Ok(answered(companion_box::response(call.inputs)))
    }
}

impl Model for CompanionPipe {
    fn signature(&self, context: &Context<'_>) -> Signature {
        signature(&companion_pipe::INPUTS, context)
    }

    fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError> {
        let condition = usize::from(call.scenario.name == "second");
        Ok(answered(companion_pipe::response(call.inputs, condition)))
    }
}

fn answered(values: Vec<f64>) -> Response {
    let valid = values.iter().all(|y| y.is_finite());
    Response { values, valid, facts: Vec::new() }
}

/// The inputs of a companion; its response is on the layout that the study asks for.
fn signature(inputs: &[(&str, f64, &str)], context: &Context<'_>) -> Signature {
    let input = |(name, default, about): &(&str, f64, &str)| Input {
        name: (*name).to_owned(),
        unit: Unit::dimensionless(),
        default: default.is_finite().then_some(*default),
        range: (f64::NEG_INFINITY, f64::INFINITY),
        description: (*about).to_owned(),
    };
    let inputs = inputs.iter().map(input).collect();
    Signature { inputs, layout: context.layout.clone(), resamples: false }
}

lacuna::register!(lacuna::plugin::Model, "companion_box", CompanionBox);
lacuna::register!(lacuna::plugin::Model, "companion_pipe", CompanionPipe);

impl Accompanied for MercuryBox {
    fn companion(&self) -> String {
        let constants = [
            ("heat", "log_uniform = [0.5, 2.0]"),
            ("gain", "log_uniform = [0.5, 2.0]"),
            ("top_mass", "log_uniform = [20.0, 400.0]"),
            ("bottom_mass", "log_uniform = [20.0, 400.0]"),
            ("front_mass", "log_uniform = [20.0, 400.0]"),
            ("rear_mass", "log_uniform = [20.0, 400.0]"),
            ("top_frequency", "log_uniform = [3e3, 3e4]"),
            ("bottom_frequency", "log_uniform = [3e3, 3e4]"),
            ("front_frequency", "log_uniform = [3e3, 3e4]"),
            ("rear_frequency", "log_uniform = [3e3, 3e4]"),
            ("wall_damping", "log_uniform = [0.005, 0.2]"),
            ("bending", "log_uniform = [0.1, 4.0]"),
            ("smoothing", "uniform = [0.02, 0.3]"),
        ];
        let switches = [
            ("damping", 2000.0),
            ("damping_front", 3000.0),
            ("damping_rear", 3000.0),
            ("damping_last", 3000.0),
            ("screen_1", 0.5),
            ("screen_2", 0.5),
            ("screen_3", 0.5),
            ("screen_4", 0.5),
            ("gas", 0.1),
            ("gas_front", 0.1),
            ("gas_rear", 0.1),
            ("gas_last", 0.1),
            ("rear_stiffness", 1.0),
            ("front_stiffness", 1.0),
            ("square_friction", 3000.0),
            ("late_cavities", 3e-5),
            ("shear", 5.0),
        ];
        section("companion_box", &constants, &switches)
    }

    fn degree(&self) -> usize {
        16
    }
}

impl Accompanied for Pipe {
    fn companion(&self) -> String {
        let constants =
            [("head", "log_uniform = [80.0, 120.0]"), ("stretch", "log_uniform = [0.95, 1.05]")];
        let switches = [
            ("unsteady_friction", 0.05),
            ("linear_friction", 0.05),
            ("creep", 0.1),
            ("friction_power", 0.5),
            ("valve_leak", 0.02),
        ];
        let along = [("leak", 1e-3), ("throttle", 50.0), ("air", 0.01)];
        section("companion_pipe", &constants, &switches) + &lines(&along, &companion_pipe::BETWEEN)
    }

    fn degree(&self) -> usize {
        8
    }
}

/// Inputs that are the same physics at several places, with the widths of their priors.
fn lines(physics: &[(&str, f64)], places: &[f64]) -> String {
    let mut text = String::new();
    for (name, width) in physics {
        for (k, at) in places.iter().enumerate() {
            let _ = write!(
                text,
                "\n[[gap.companion.switch]]\ninput = \"{name}_{}\"\nprior = {{ half_normal = {width:?} }}\n\
                 place = {{ of = \"{name}\", at = {at:?} }}\n",
                k + 1
            );
        }
    }
    text
}

/// `[gap.companion]` with constants and their priors, and inputs with the widths of theirs.
fn section(model: &str, constants: &[(&str, &str)], switches: &[(&str, f64)]) -> String {
    let mut text = format!("\n[gap.companion]\nuse = \"{model}\"\n");
    for (name, prior) in constants {
        let _ = write!(
            text,
            "\n[[gap.companion.parameter]]\nname = \"{name}\"\nprior = {{ {prior} }}\n"
        );
    }
    for (name, width) in switches {
        let _ = write!(
            text,
            "\n[[gap.companion.switch]]\ninput = \"{name}\"\nprior = {{ half_normal = {width:?} }}\n"
        );
    }
    text
}
