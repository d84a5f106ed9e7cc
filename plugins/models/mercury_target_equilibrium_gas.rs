//! The mercury target with gas in pressure equilibrium.

use std::path::Path;

use lacuna::plugin::model::{Call, EvalError, Response, Signature};
use lacuna::plugin::{Component, Context};
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mercury_target::{Filling, MercuryTarget, filled};

/// `mercury_target` with helium in pressure equilibrium with the mercury.
///
/// Vessel, pulse, numerics and response are those of `mercury_target`. The strain of a cell is that of the mercury
/// plus the change of the gas, which has the mercury's pressure at any time:
/// `ε = -(p - p₀)/K + a₀ ((P/(p + P))^(1/κ) - 1)` with the gas volume fraction `a₀` at rest; the pressure is limited to
/// minus the tensile cutoff as in `mercury_target`. Small waves propagate at Wood's speed.
///
/// Inputs: those of `mercury_target_bubbles` without `bubble_radius`. A study may still set `bubble_radius`, so that
/// the model can be exchanged by its name alone; it has no effect here. Without gas (`void_fraction` = 0) the
/// response equals that of `mercury_target` to the last bit.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MercuryTargetEquilibriumGas(MercuryTarget);

impl Component for MercuryTargetEquilibriumGas {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.0.check(context, complaints);
    }
}

filled!(MercuryTargetEquilibriumGas, "mercury_target_equilibrium_gas", EquilibriumGas, 0);
