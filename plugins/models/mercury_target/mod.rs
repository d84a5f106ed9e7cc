//! An open stand-in for the simulation of the liquid mercury target of the Spallation Neutron
//! Source: strains of a steel vessel after a proton pulse has heated the mercury inside.
//!
//! # What it is, and is not
//!
//! The calibration study that this project follows (Radaideh et al., arXiv 2202.03959) used a
//! Sierra/SolidMechanics model. That model, its input decks and the strain measurements are not
//! public. This is a much simpler vessel with the same ingredients: the same equation of state
//! with the same three unknowns, wave speeds and impedances of mercury and 316L steel, a pulse of
//! the right size and shape, ten gauges with the same names, and traces over 1 ms in steps of
//! 10 µs. Peaks, times and frequencies are of the right kind; no number is a prediction for SNS.
//!
//! # Vessel and load
//!
//! A cylinder (radius 100 mm, length 450 mm) with a spherical cap (radius 160 mm) as beam window,
//! walls of 3 mm, axially symmetric, in vacuum, the wall clamped at the rear. The pulse is
//! instantaneous: `p₀ = P₀ exp(-r²/2s²) f(z')/max f`, `f = (1 - exp(-z'/l₁)) exp(-z'/l₂)` with
//! `s` = 32 mm, `l₁` = 20 mm, `l₂` = 160 mm behind the window, `P₀` = 36e6 Pa at Riemer's values
//! (13500 kg/m³, 1456 m/s); the cap expands by 20 microstrain on the axis. Under `thermal_strain`
//! (the default) the deposited energy fixes the expansion, so `p₀` grows with `ρc²`; under
//! `fixed_pressure` it does not depend on the mercury. The published work does not say which
//! holds there. `fixed_pressure` makes soft mercury (`c` → 0) deform without bound: see `valid`.
//!
//! # Equations
//!
//! - Fluid: `ρ v' = -grad p`, `ε' = div v`, `p = max(p₀ - K ε, -p_c)`, `K = ρc²`, small
//!   displacements; pressures count from the static state. The law is single-valued, hence
//!   reversible (Bleich & Sandler, Int. J. Solids Structures 6, 1970).
//! - Wall: Mindlin shell of revolution; its equations stand in the module `shell`.
//! - Gas, in the models `mercury_target_equilibrium_gas` and `mercury_target_bubbles`: the strain is
//!   that of the liquid and of bubbles, in equilibrium or over-damped; see the module `gas`.
//! - Contact: fluid and wall share the motion along the normal and slip along the meridian.
//! - Rear: mercury without end (absorbing) or rigid.
//!
//! # Numerics
//!
//! Explicit leapfrog on a structured mesh of 20 x 90 quadrilaterals with one pressure each;
//! forces are the exact derivatives of the cells' volumes, so that without damping the linear
//! scheme conserves energy to rounding. Artificial viscosity (`b₁` = 0.25, `b₂` = 1.2) spreads the
//! shocks of closing cavities; hourglass viscosity 0.01. The step is 0.7 of the stability limit
//! of the worst element (an upper bound for the mesh), rounded so that outputs fall on steps.
//!
//! # Limits
//!
//! - Closing cavities make the traces sensitive: changing a parameter by 0.1 % scatters them by
//!   about 1 microstrain rms, refining the mesh twice changes them by about 9 (no surrogate can
//!   be better than that). The linear viscosity decides this noise floor.
//! - `valid` is false when any volumetric strain reaches 0.1: displacements are then no longer
//!   small. The largest values are on the axis, where cavities gather.
//! - One cross section stands for the 400 mm x 100 mm one: no difference between top and bottom,
//!   no baffles, no flow, no second wall.
//! - Gauge positions, thicknesses and the beam's shape are plausible, not measured.
//!
//! # Tests
//!
//! Breathing modes of the filled tube, ring frequency, Korteweg's speed, Taylor's plate,
//! cavitation and closure under a floating plate (against an independent computation by
//! characteristics), water hammer into a cavitated column, plate and cylinder theory for the
//! wall, rigid acoustics of second order, balances of energy and momentum, reversal, scaling
//! invariances, mesh convergence and survival over the whole design box. Bubbly mercury: Wood's
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

/// The calibrated quantities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mercury {
    /// Density, kg/m³.
    pub density: f64,
    /// Sound speed, m/s.
    pub sound_speed: f64,
    /// Tensile cutoff: the fluid bears no pressure below minus this, Pa.
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

/// What a run gives.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Output times, s.
    pub times: Vec<f64>,
    /// Strain of each gauge (in the order of the gauge table) at each time; dimensionless.
    pub strain: Vec<Vec<f64>>,
    /// Whether all volumetric strains stayed below 0.1 in size, as small displacements demand.
    pub valid: bool,
    /// Largest size of the volumetric strain in any cell at any step.
    pub largest_volumetric_strain: f64,
    /// Longest uninterrupted time that any cell spent at the cutoff, s.
    pub saturation_time: f64,
    /// Share of the fluid's volume at the cutoff, at each output time.
    pub cavitated_fraction: Vec<f64>,
    /// Energies at the last output.
    pub energy: EnergyBalance,
    /// Time steps taken.
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

/// Why a run gives nothing.
#[derive(Debug, Clone, PartialEq)]
pub enum SimulationError {
    /// A setting or parameter without meaning.
    Settings(String),
    /// The time step would be too small to finish.
    TooManySteps {
        /// Steps needed.
        steps: f64,
    },
    /// A strain left the range of numbers.
    NotFinite {
        /// Output time at which it was found, s.
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
                write!(f, "the simulation left the range of numbers before t = {time} s")
            }
        }
    }
}

impl std::error::Error for SimulationError {}

#[cfg(test)]
mod tests;
