//! The mercury target with bubbles that follow the pressure with a delay.

use std::path::Path;

use lacuna::plugin::model::{Call, EvalError, Response, Signature};
use lacuna::plugin::{Component, Context};
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mercury_target::{Filling, MercuryTarget, filled};

/// `mercury_target` with helium bubbles that follow the pressure with a delay.
///
/// Vessel, pulse, numerics and response are those of `mercury_target`. In each cell the gas has a volume fraction
/// `a`, equal to `a₀` at rest, and the pressure `P (a₀/a)^κ`. The bubbles are over-damped: `η a' = p_gas - p_mercury`
/// with `η = κPτ/a₀`, where `τ = R √(ρ/3κP)` is `1/2πf₀` of Minnaert's frequency. Small bubbles act like gas in
/// equilibrium (`mercury_target_equilibrium_gas`); large ones respond too late to affect the first rise.
///
/// Inputs in addition to `density`, `sound_speed` and `tensile_cutoff` of the mercury:
///
/// - `void_fraction`, `a₀` far behind the window; `void_gradient` `g` and `void_depletion` `d` with its
///   `depletion_length` `l` stratify it: `a₀ (1 + g (2r²/a² - 1)) (1 - d exp(-z'/l))`, with the radius `a` of the
///   vessel and the distance `z'` behind the window. The model is axially symmetric and does not distinguish top from
///   bottom: gas that has risen to a wall is represented by gas near the wall, `g > 0`.
/// - `bubble_radius` `R`, `ambient_pressure` `P` (static), `polytropic_index` `κ`.
/// - `damping` (1/s: vibrations decay as exp(-damping t / 2)), `pulse_energy` and `wall_thickness` (relative to the
///   options), `beam_width` (m).
///
/// All have defaults. Without gas (`void_fraction` = 0) the response equals that of `mercury_target` to the last bit.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MercuryTargetBubbles(MercuryTarget);

impl Component for MercuryTargetBubbles {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.0.check(context, complaints);
    }
}

filled!(MercuryTargetBubbles, "mercury_target_bubbles", Bubbles, 0);
