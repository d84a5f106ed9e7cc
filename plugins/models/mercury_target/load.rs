//! State after the proton pulse: initial pressure of the fluid and thermal expansion of the cap.

use super::Mercury;
use super::mesh::Mesh;
use super::settings::{Geometry, Load, Pulse};

impl Pulse {
    /// Deposited energy density at (r, z) divided by its peak; coordinates in m.
    pub fn shape(&self, geometry: &Geometry, r: f64, z: f64) -> f64 {
        let depth = (z - geometry.nose(r)).max(0.0);
        let along = |depth: f64| (1.0 - (-depth / self.rise).exp()) * (-depth / self.decay).exp();
        let peak = along(self.rise * (self.decay / self.rise).ln_1p());
        self.across(r) * along(depth) / peak
    }

    /// Intensity of the beam at radius `r`, m, divided by its peak.
    pub fn across(&self, r: f64) -> f64 {
        (-r * r / (2.0 * self.width * self.width)).exp()
    }

    /// Peak initial pressure in the given mercury, Pa.
    pub fn pressure(&self, mercury: &Mercury) -> f64 {
        let modulus = |density: f64, speed: f64| density * speed * speed;
        match self.load {
            Load::FixedPressure => self.peak_pressure,
            Load::ThermalStrain => {
                self.peak_pressure * modulus(mercury.density, mercury.sound_speed)
                    / modulus(self.reference_density, self.reference_sound_speed)
            }
        }
    }
}

/// Relative energy deposition at the centre of each cell.
pub fn cell_shapes(mesh: &Mesh, geometry: &Geometry, pulse: &Pulse) -> Vec<f64> {
    mesh.centres().map(|[r, z]| pulse.shape(geometry, r, z)).collect()
}
