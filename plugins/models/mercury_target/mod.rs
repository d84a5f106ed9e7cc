//! Stand-in for the model of the SNS mercury target.

mod coupling;
mod eos;
mod fluid;
mod gauges;
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
pub use gauges::Sensor;
pub use mesh::Mesh;
pub use model::MercuryTarget;
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
