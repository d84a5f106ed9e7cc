//! Inputs of the models of this vessel.
//!
//! Each model lists its own inputs. Of the other models' inputs it accepts those that a study sets, so that a study
//! can change its model by name alone: inputs of the vessel and the pulse have an effect in all models; inputs of a
//! gas that the model does not have are accepted and have no effect.

use lacuna::plugin::Context;
use lacuna::plugin::model::{Call, EvalError, Input};

use super::model::unit;
use super::{Gas, Mercury, MercuryTarget, Outcome, Settings, SimulationError, Target};

/// Content of the vessel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Filling {
    /// Pure mercury.
    Mercury,
    /// Mercury with gas in pressure equilibrium.
    EquilibriumGas,
    /// Mercury with bubbles that respond with a delay.
    Bubbles,
}

/// Input values of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Values {
    mercury: Mercury,
    gas: Gas,
    damping: f64,
    pulse_energy: f64,
    beam_width: f64,
    wall_thickness: f64,
    rear_reflection: f64,
}

impl Values {
    fn default_of(target: &MercuryTarget) -> Self {
        Self {
            mercury: Mercury { density: 13_500.0, sound_speed: 1456.0, tensile_cutoff: 1.5e5 },
            gas: Gas::default(),
            damping: 0.0,
            pulse_energy: 1.0,
            beam_width: target.pulse.width,
            wall_thickness: 1.0,
            rear_reflection: 0.0,
        }
    }

    /// Runs the simulation with these values in place of the corresponding settings.
    pub fn simulate(
        &self,
        filling: Filling,
        settings: Settings,
    ) -> Result<Outcome, SimulationError> {
        let target = Target::new(&self.applied(settings))?;
        match filling {
            Filling::Mercury => target.simulate(&self.mercury),
            Filling::EquilibriumGas => {
                target.simulate_with_gas(&self.mercury, &Gas { bubble_radius: 0.0, ..self.gas })
            }
            Filling::Bubbles => target.simulate_with_gas(&self.mercury, &self.gas),
        }
    }

    /// Settings with these values of vessel and pulse.
    fn applied(&self, mut settings: Settings) -> Settings {
        settings.damping = self.damping;
        settings.pulse.peak_pressure *= self.pulse_energy;
        settings.pulse.wall_strain *= self.pulse_energy;
        settings.pulse.width = self.beam_width;
        settings.rear_reflection = self.rear_reflection;
        settings.wall.cap_thickness *= self.wall_thickness;
        settings.wall.cylinder_thickness *= self.wall_thickness;
        settings
    }
}

/// Group of models that have an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Mercury,
    /// Vessel and pulse: the input acts in all models; the model without gas lists it only if the study sets it.
    Vessel,
    Gas,
    Bubbles,
}

impl Part {
    fn is_listed(self, filling: Filling) -> bool {
        match self {
            Self::Mercury => true,
            Self::Vessel | Self::Gas => filling >= Filling::EquilibriumGas,
            Self::Bubbles => filling == Filling::Bubbles,
        }
    }

    fn acts(self, filling: Filling) -> bool {
        self == Self::Vessel || self.is_listed(filling)
    }
}

struct Entry {
    name: &'static str,
    part: Part,
    unit: &'static str,
    range: (f64, f64),
    description: &'static str,
    place: fn(&mut Values) -> &mut f64,
}

const fn entry(
    part: Part,
    name: &'static str,
    unit: &'static str,
    range: (f64, f64),
    description: &'static str,
    place: fn(&mut Values) -> &mut f64,
) -> Entry {
    Entry { name, part, unit, range, description, place }
}

const ENTRIES: [Entry; 15] = [
    entry(
        Part::Mercury,
        "density",
        "kg/m3",
        (f64::MIN_POSITIVE, f64::INFINITY),
        "density of mercury",
        |v| &mut v.mercury.density,
    ),
    entry(
        Part::Mercury,
        "sound_speed",
        "m/s",
        (0.0, f64::INFINITY),
        "sound speed of mercury",
        |v| &mut v.mercury.sound_speed,
    ),
    entry(
        Part::Mercury,
        "tensile_cutoff",
        "Pa",
        (0.0, f64::INFINITY),
        "tension at which mercury cavitates",
        |v| &mut v.mercury.tensile_cutoff,
    ),
    entry(
        Part::Gas,
        "void_fraction",
        "1",
        (0.0, 0.05),
        "volume fraction of the gas at rest, away from the window",
        |v| &mut v.gas.void_fraction,
    ),
    entry(
        Part::Gas,
        "void_gradient",
        "1",
        (-1.0, 1.0),
        "stratification g over the radius: the gas varies as 1 + g (2r²/a² - 1); more near the wall for g > 0",
        |v| &mut v.gas.gradient,
    ),
    entry(
        Part::Gas,
        "void_depletion",
        "1",
        (0.0, 1.0),
        "stratification d along the axis: the gas varies as 1 - d exp(-z'/l) behind the window",
        |v| &mut v.gas.depletion,
    ),
    entry(
        Part::Gas,
        "depletion_length",
        "m",
        (1e-4, 10.0),
        "decay length l of the gas that is missing at the window",
        |v| &mut v.gas.depletion_length,
    ),
    entry(
        Part::Bubbles,
        "bubble_radius",
        "m",
        (0.0, 0.01),
        "radius of the bubbles; 0 for gas that is always in equilibrium",
        |v| &mut v.gas.bubble_radius,
    ),
    entry(
        Part::Gas,
        "ambient_pressure",
        "Pa",
        (1e3, 1e8),
        "static pressure of mercury and gas",
        |v| &mut v.gas.ambient_pressure,
    ),
    entry(
        Part::Gas,
        "polytropic_index",
        "1",
        (1.0, 2.0),
        "polytropic index of the gas: 1 isothermal, 5/3 adiabatic helium",
        |v| &mut v.gas.polytropic_index,
    ),
    entry(
        Part::Vessel,
        "damping",
        "1/s",
        (0.0, 1e6),
        "damping in proportion to mass: vibrations decay as exp(-damping t / 2)",
        |v| &mut v.damping,
    ),
    entry(
        Part::Vessel,
        "pulse_energy",
        "1",
        (0.0, 100.0),
        "energy of the pulse divided by that of the options",
        |v| &mut v.pulse_energy,
    ),
    entry(
        Part::Vessel,
        "beam_width",
        "m",
        (1e-3, 10.0),
        "standard deviation of the beam, in place of the option `pulse.width`",
        |v| &mut v.beam_width,
    ),
    entry(
        Part::Vessel,
        "wall_thickness",
        "1",
        (0.05, 20.0),
        "thickness of the walls divided by that of the options",
        |v| &mut v.wall_thickness,
    ),
    entry(
        Part::Vessel,
        "rear_reflection",
        "1",
        (-0.999, 0.999),
        "share of the pressure that the rear end reflects: 0 absorbs all waves, 1 would be a rigid wall",
        |v| &mut v.rear_reflection,
    ),
];

/// The inputs that a model lists in a study.
pub(super) fn inputs(
    target: &MercuryTarget,
    filling: Filling,
    context: &Context<'_>,
) -> Vec<Input> {
    let defaults = Values::default_of(target);
    let is_given = |name: &str| context.given.iter().any(|given| given.name == name);
    let input = |entry: &Entry| Input {
        name: entry.name.to_owned(),
        unit: unit(entry.unit),
        default: Some(*(entry.place)(&mut defaults.clone())),
        range: entry.range,
        description: if entry.part.acts(filling) {
            entry.description.to_owned()
        } else {
            format!("{}; without effect in this model", entry.description)
        },
    };
    let listed = ENTRIES.iter().filter(|entry| entry.part.is_listed(filling));
    let others = ENTRIES.iter().filter(|e| !e.part.is_listed(filling) && is_given(e.name));
    listed.chain(others).map(input).collect()
}

/// The names of the inputs that a study sets and that have no effect in the model.
pub(crate) fn unused(filling: Filling, context: &Context<'_>) -> Vec<String> {
    let idle = |name: &str| ENTRIES.iter().any(|e| e.name == name && !e.part.acts(filling));
    let names = context.given.iter().map(|given| given.name.clone());
    names.filter(|name| idle(name)).collect()
}

/// The values of a call, and the names of the inputs without effect. Fails if an input is unknown or out of range.
pub(super) fn values(
    target: &MercuryTarget,
    filling: Filling,
    call: &Call<'_>,
) -> Result<(Values, Vec<&'static str>), EvalError> {
    let (expected, found) = (call.names.len(), call.inputs.len());
    if expected != found {
        return Err(EvalError::Fatal(format!("expected {expected} inputs, found {found}")));
    }
    let mut values = Values::default_of(target);
    let mut idle = Vec::new();
    for (name, &value) in call.names.iter().zip(call.inputs) {
        let Some(entry) = ENTRIES.iter().find(|entry| entry.name == name) else {
            return Err(EvalError::Fatal(format!("the model has no input `{name}`")));
        };
        let (low, high) = entry.range;
        // The settings of mercury have their own messages.
        if entry.part != Part::Mercury && !(low..=high).contains(&value) {
            let unit = if entry.unit == "1" { String::new() } else { format!(" {}", entry.unit) };
            return Err(EvalError::Fatal(format!(
                "`{name}` is {value}; it must be from {low} to {high}{unit}"
            )));
        }
        if entry.part.acts(filling) {
            *(entry.place)(&mut values) = value;
        } else {
            idle.push(entry.name);
        }
    }
    Ok((values, idle))
}

/// The inputs of a call with their units, one per line.
pub(super) fn deck<'a>(call: &'a Call<'_>) -> impl Iterator<Item = String> + 'a {
    let unit = |name: &str| {
        let entry = ENTRIES.iter().find(|entry| entry.name == name);
        entry.map_or_else(String::new, |entry| format!(" {}", entry.unit))
    };
    call.names
        .iter()
        .zip(call.inputs)
        .map(move |(name, value)| format!("{name} = {value}{}", unit(name)))
}
