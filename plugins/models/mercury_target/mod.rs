//! An open stand-in for the simulation of the liquid mercury target of the Spallation Neutron Source: strains of a
//! steel vessel after a proton pulse has heated the mercury inside.
//!
//! # Scope
//!
//! The calibration study that this project follows (Radaideh et al., arXiv 2202.03959) used a Sierra/SolidMechanics
//! model. That model, its input decks and the strain measurements are not public. This is a much simpler vessel with
//! the same ingredients: the same equation of state with the same three unknowns, wave speeds and impedances of
//! mercury and 316L steel, a pulse of the right size and shape, ten gauges with the same names, and traces over 1 ms
//! in steps of 10 µs. Peaks, times and frequencies are realistic; no number is a prediction for SNS.
//!
//! # Vessel and load
//!
//! A cylinder (radius 100 mm, length 450 mm) with a spherical cap (radius 160 mm) as beam window, walls of 3 mm,
//! axially symmetric, in vacuum, with the wall clamped at the rear. The pulse is instantaneous:
//! `p₀ = P₀ exp(-r²/2s²) f(z')/max f`, `f = (1 - exp(-z'/l₁)) exp(-z'/l₂)` with `s` = 32 mm, `l₁` = 20 mm, `l₂` = 160
//! mm behind the window, `P₀` = 36e6 Pa at Riemer's values (13500 kg/m³, 1456 m/s); the cap expands by 20 microstrain
//! on the axis. Under `thermal_strain` (the default) the deposited energy fixes the expansion, so that `p₀` grows with
//! `ρc²`; under `fixed_pressure` it does not depend on the mercury. The published work does not say which of these it
//! used. With `fixed_pressure` soft mercury (`c` → 0) deforms without bound: see `valid`.
//!
//! # Equations
//!
//! - Fluid: `ρ v' = -grad p`, `ε' = div v`, `p = max(p₀ - K ε, -p_c)`, `K = ρc²`, small displacements; pressures are
//!   relative to the static state. The law is single-valued and hence reversible (Bleich & Sandler, Int. J. Solids
//!   Structures 6, 1970).
//! - Wall: Mindlin shell of revolution; its equations are in the module `shell`.
//! - Gas, in the models `mercury_target_equilibrium_gas` and `mercury_target_bubbles`: the strain is that of the
//!   liquid and of bubbles, in equilibrium or over-damped; see the module `gas`.
//! - Contact: fluid and wall share the motion along the normal and slip along the meridian.
//! - Rear: semi-infinite mercury (absorbing) or rigid.
//!
//! # Numerics
//!
//! Explicit leapfrog on a structured mesh of 20 x 90 quadrilaterals with one pressure each; forces are the exact
//! derivatives of the cells' volumes, so that without damping the linear scheme conserves energy to rounding.
//! Artificial viscosity (`b₁` = 0.25, `b₂` = 1.2) spreads the shocks of closing cavities; the hourglass viscosity is
//! 0.01. The step is 0.7 of the stability limit of the worst element (a bound for the whole mesh), rounded so that
//! outputs fall on steps.
//!
//! # Limits
//!
//! - Closing cavities make the traces sensitive: changing a parameter by 0.1 % scatters them by about 1 microstrain
//!   rms, and refining the mesh by a factor of two changes them by about 9 (no surrogate can be more accurate than
//!   that). The linear viscosity determines this noise floor.
//! - `valid` is false if any volumetric strain reaches 0.1: displacements are then no longer small. The largest
//!   values are on the axis, where cavities gather.
//! - One cross section represents that of 400 mm x 100 mm: there is no difference between top and bottom, and there
//!   are no baffles, no flow and no second wall.
//! - Gauge positions, thicknesses and the shape of the beam are plausible, not measured.
//!
//! # Tests
//!
//! Breathing modes of the filled tube, ring frequency, Korteweg's speed, Taylor's plate, cavitation and closure under
//! a floating plate (against an independent computation by characteristics), water hammer into a cavitated column,
//! plate and cylinder theory for the wall, rigid acoustics of second order, balances of energy and momentum,
//! reversal, scaling invariances, mesh convergence and survival over the whole design box. Bubbly mercury: Wood's
//! speed, the linear waves of the relaxation and of Commander and Prosperetti, its limits.

mod coupling;
mod eos;
mod fluid;
mod gas;
mod gauges;
mod inputs;
mod load;
mod mesh;
mod model;
mod settings;
mod shell;
mod solver;
mod target;

use std::fmt;

pub use coupling::{Contact, Field, Held, Joints};
pub use eos::{EquationOfState, TensileCutoff};
pub use fluid::{Fluid, FluidConstants};
pub use gas::{Bubbles, Bubbly, Gas};
pub use gauges::Sensor;
pub(crate) use inputs::{Filling, unused};
pub use mesh::Mesh;
pub use model::MercuryTarget;
pub(crate) use model::filled;
pub use settings::{
    Cells, Gauge, Gauges, Geometry, Load, NamedMesh, Numerics, Place, Pulse, Rear, Sampling,
    Settings, Wall,
};
pub use shell::{Element, Shell, Steel};
pub use solver::{EnergyBalance, Solver, Vessel};
pub use target::{Target, simulate};

/// Calibrated quantities of the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mercury {
    /// Density in kg/m³.
    pub density: f64,
    /// Sound speed in m/s.
    pub sound_speed: f64,
    /// Tensile cutoff in Pa: the pressure is limited to minus this value.
    pub tensile_cutoff: f64,
}

impl Mercury {
    fn validate(&self) -> Result<(), SimulationError> {
        let refuse = |name, value, right| {
            Err(SimulationError::Settings(format!("`{name}` is {value}; it must be {right}")))
        };
        let zero_or_more = |x: f64| x.is_finite() && x >= 0.0;
        if !(self.density.is_finite() && self.density > 0.0) {
            return refuse("density", self.density, "a positive number of kg/m³");
        }
        if !zero_or_more(self.sound_speed) {
            return refuse("sound_speed", self.sound_speed, "zero or more m/s");
        }
        if !zero_or_more(self.tensile_cutoff) {
            return refuse("tensile_cutoff", self.tensile_cutoff, "zero or more Pa");
        }
        Ok(())
    }
}

/// Result of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Output times in s.
    pub times: Vec<f64>,
    /// Strain of each gauge (in the order of the gauge table) at each time; dimensionless.
    pub strain: Vec<Vec<f64>>,
    /// True if all volumetric strains stayed below 0.1 in magnitude, as small displacements require.
    pub valid: bool,
    /// Largest magnitude of the volumetric strain in any cell at any step.
    pub largest_volumetric_strain: f64,
    /// Longest uninterrupted time that any cell spent at the cutoff, in s.
    pub saturation_time: f64,
    /// Fraction of the fluid's volume at the cutoff, at each output time.
    pub cavitated_fraction: Vec<f64>,
    /// Energies at the last output.
    pub energy: EnergyBalance,
    /// Number of time steps.
    pub steps: usize,
}

impl Outcome {
    fn empty(gauges: usize, outputs: usize) -> Self {
        Self {
            times: Vec::with_capacity(outputs),
            strain: vec![Vec::with_capacity(outputs); gauges],
            valid: true,
            largest_volumetric_strain: 0.0,
            saturation_time: 0.0,
            cavitated_fraction: Vec::with_capacity(outputs),
            energy: EnergyBalance::default(),
            steps: 0,
        }
    }
}

/// Reason for which a run gives no result.
#[derive(Debug, Clone, PartialEq)]
pub enum SimulationError {
    /// An invalid setting or parameter.
    Settings(String),
    /// Too many time steps would be needed.
    TooManySteps {
        /// Number of steps needed.
        steps: f64,
    },
    /// A strain is not finite.
    NotFinite {
        /// Output time at which it was found, in s.
        time: f64,
    },
}

impl fmt::Display for SimulationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Settings(message) => f.write_str(message),
            Self::TooManySteps { steps } => write!(
                f,
                "the run would need {steps:.0} time steps, over the limit of 5 million; use a \
                 coarser `mesh`, a shorter time or a smaller `sound_speed`"
            ),
            Self::NotFinite { time } => {
                write!(f, "a value of the simulation is not finite before t = {time} s")
            }
        }
    }
}

impl std::error::Error for SimulationError {}

#[cfg(test)]
mod tests;
