//! The stand-in's vessel with bubbles that take time to follow the pressure.

use std::path::Path;

use lacuna::plugin::model::{Call, EvalError, Response, Signature};
use lacuna::plugin::{Component, Context};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mercury_target::{Filling, MercuryTarget, filled};

/// `mercury_target` with helium bubbles that take time to follow the pressure.
///
/// Vessel, pulse, numerics and response are those of `mercury_target`. In each cell the gas has a volume fraction
/// `a`, of `a₀` at rest, and its pressure is `P (a₀/a)^κ`. Bubbles are over-damped: `η a' = p_gas - p_mercury` with
/// `η = κPτ/a₀`, where `τ = R √(ρ/3κP)` is `1/2πf₀` of Minnaert's frequency. Small bubbles act like gas in
/// equilibrium (`mercury_target_equilibrium_gas`), large ones come too late for the first rise.
///
/// Inputs beside `density`, `sound_speed` and `tensile_cutoff` of the mercury:
///
/// - `void_fraction`, `a₀` far behind the window; `void_gradient` `g` and `void_depletion` `d` with its
///   `depletion_length` `l` stratify it: `a₀ (1 + g (2r²/a² - 1)) (1 - d exp(-z'/l))`, with the radius `a` of the vessel
///   and the distance `z'` behind the window. Nothing here knows top from bottom: gas that has risen to a wall is
///   gas near the wall, `g > 0`.
/// - `bubble_radius` `R`, `ambient_pressure` `P` (static), `polytropic_index` `κ`.
/// - `damping` (1/s: vibrations fall off as exp(-damping t / 2)), `pulse_energy` and `wall_thickness` (relative to the
///   options), `beam_width` (m).
///
/// All have defaults. Without gas (`void_fraction` = 0) the response is that of `mercury_target` to the last bit.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MercuryTargetBubbles(MercuryTarget);

impl Component for MercuryTargetBubbles {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.0.check(context, complaints);
    }
}

filled!(MercuryTargetBubbles, "mercury_target_bubbles", Bubbles, 0);
