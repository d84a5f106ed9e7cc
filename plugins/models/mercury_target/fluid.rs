//! The fluid: strains, pressures, artificial viscosity, hourglass control and nodal forces.
//!
//! Small displacements on a fixed mesh, inviscid: `ρ v' = -grad p`, `ε' = div v`. Shocks are spread by
//! `q = -b₁ρcl d + ρ(b₂l d)²` (the second term in compression only), `d = div v`, multiplied by the current relative
//! speed of small waves: zero where the fluid is cavitated. The loops run along mesh rows over slices of equal length,
//! which the compiler vectorises.

use super::coupling::Field;
use super::eos::EquationOfState;
use super::mesh::{CORNERS, Corner, Mesh};

/// Density and numerical damping of the fluid.
#[derive(Debug, Clone, Copy)]
pub struct FluidConstants {
    /// Density, kg/m³.
    pub density: f64,
    /// Linear artificial viscosity `b₁`, dimensionless.
    pub linear_viscosity: f64,
    /// Quadratic artificial viscosity `b₂`, dimensionless.
    pub quadratic_viscosity: f64,
    /// Hourglass coefficient, dimensionless.
    pub hourglass: f64,
}

/// State of the fluid's cells. Every vector has one entry per cell.
#[derive(Debug, Clone)]
pub struct Fluid<E> {
    /// Equation of state with its own state.
    pub eos: E,
    /// Volumetric strain since the pulse.
    pub strain: Vec<f64>,
    /// Pressure relative to the static state, Pa.
    pub pressure: Vec<f64>,
    /// Current speed of small waves divided by the sound speed; 0 where the fluid is cavitated.
    pub speed: Vec<f64>,
    /// Longest uninterrupted time at the cutoff so far, s.
    pub longest_saturation: Vec<f64>,
    /// Largest magnitude of the volumetric strain so far.
    pub largest_strain: Vec<f64>,
    /// Energy lost to the artificial viscosity so far, J.
    pub viscous_loss: Vec<f64>,
    /// Energy lost to the hourglass control so far, J.
    pub hourglass_loss: Vec<f64>,
    saturation: Vec<f64>,
    rate: Vec<f64>,
    viscous_pressure: Vec<f64>,
    hourglass_r: Vec<f64>,
    hourglass_z: Vec<f64>,
    linear: Vec<f64>,
    quadratic: Vec<f64>,
    ceiling: Vec<f64>,
    resistance: Vec<f64>,
}

/// The values of a nodal quantity at the four corners of each cell of mesh row `j`.
fn corners<'a>(mesh: &Mesh, nodal: &'a [f64], j: usize) -> [&'a [f64]; CORNERS] {
    let (nz, row) = (mesh.nz, mesh.nz + 1);
    let inner = &nodal[j * row..][..row];
    let outer = &nodal[(j + 1) * row..][..row];
    [&inner[..nz], &outer[..nz], &outer[1..][..nz], &inner[1..][..nz]]
}

/// Row `j` of a corner array.
fn weights<'a>(mesh: &Mesh, b: &'a Corner, j: usize) -> [&'a [f64]; CORNERS] {
    let nz = mesh.nz;
    std::array::from_fn(|k| &b[k][j * nz..][..nz])
}

/// Longest stable time step of the fluid with its linear viscosity, s; infinite at zero sound speed.
pub fn stable_step(mesh: &Mesh, sound_speed: f64, linear_viscosity: f64) -> f64 {
    mesh.wave_number2
        .iter()
        .zip(&mesh.thickness)
        .map(|(&k2, &l)| {
            let damping = 0.5 * linear_viscosity * l * k2.sqrt();
            2.0 / (sound_speed * k2.sqrt()) * ((1.0 + damping * damping).sqrt() - damping)
        })
        .fold(f64::INFINITY, f64::min)
}

impl<E: EquationOfState> Fluid<E> {
    /// The fluid at rest just after the pulse. `dt` is the time step, s.
    pub fn new(mesh: &Mesh, constants: FluidConstants, eos: E, dt: f64) -> Self {
        let FluidConstants { density, linear_viscosity: b1, quadratic_viscosity: b2, hourglass } =
            constants;
        let c = eos.sound_speed();
        let zeros = || vec![0.0; mesh.volume.len()];
        let by_thickness = |f: &dyn Fn(f64) -> f64| mesh.thickness.iter().map(|&l| f(l)).collect();
        // The leapfrog, whose damping is that of the previous step, is stable while `c²k²dt²/4 + νk²dt/2 <= 1`; the
        // viscosity `ν` is limited accordingly.
        let ceiling = |&k2: &f64| 1.8 * (1.0 - c * c * k2 * dt * dt / 4.0).max(0.0) / (k2 * dt);
        let mut fluid = Self {
            linear: by_thickness(&|l| b1 * c * l),
            quadratic: by_thickness(&|l| b2 * b2 * l * l),
            ceiling: mesh.wave_number2.iter().map(|k2| density * ceiling(k2)).collect(),
            resistance: (mesh.volume.iter().zip(&mesh.thickness))
                .map(|(&v, &l)| hourglass * density * c * 4.0 * v / l)
                .collect(),
            strain: zeros(),
            pressure: zeros(),
            speed: zeros(),
            longest_saturation: zeros(),
            largest_strain: zeros(),
            viscous_loss: zeros(),
            hourglass_loss: zeros(),
            saturation: zeros(),
            rate: zeros(),
            viscous_pressure: zeros(),
            hourglass_r: zeros(),
            hourglass_z: zeros(),
            eos,
        };
        for coefficient in fluid.linear.iter_mut().chain(&mut fluid.quadratic) {
            *coefficient *= density;
        }
        for dt in [0.0, 0.5 * dt] {
            fluid.eos.update(0, &fluid.strain, dt, &mut fluid.pressure, &mut fluid.speed);
        }
        fluid
    }

    /// Advances the fluid by `dt`, s, with the given velocities, m/s.
    pub fn advance(&mut self, mesh: &Mesh, velocity: &Field, dt: f64) {
        for j in 0..mesh.nr {
            self.strain_row(mesh, velocity, j, dt);
            let row = j * mesh.nz..(j + 1) * mesh.nz;
            self.eos.update(
                row.start,
                &self.strain[row.clone()],
                dt,
                &mut self.pressure[row.clone()],
                &mut self.speed[row],
            );
            self.viscosity_row(mesh, j, dt);
            self.hourglass_row(mesh, velocity, j, dt);
        }
    }

    fn strain_row(&mut self, mesh: &Mesh, velocity: &Field, j: usize, dt: f64) {
        let (n, at) = (mesh.nz, j * mesh.nz);
        let [r0, r1, r2, r3] = corners(mesh, &velocity.fluid_r, j);
        let [z0, z1, z2, z3] = corners(mesh, &velocity.fluid_z, j);
        let [br0, br1, br2, br3] = weights(mesh, &mesh.b_r, j);
        let [bz0, bz1, bz2, bz3] = weights(mesh, &mesh.b_z, j);
        let volume = &mesh.volume[at..][..n];
        let rate = &mut self.rate[at..][..n];
        for i in 0..n {
            let radial = br0[i] * r0[i] + br1[i] * r1[i] + br2[i] * r2[i] + br3[i] * r3[i];
            let axial = bz0[i] * z0[i] + bz1[i] * z1[i] + bz2[i] * z2[i] + bz3[i] * z3[i];
            rate[i] = (radial + axial) / volume[i];
        }
        let strain = &mut self.strain[at..][..n];
        let largest = &mut self.largest_strain[at..][..n];
        for i in 0..n {
            strain[i] += dt * rate[i];
            let size = strain[i].abs();
            largest[i] = if size > largest[i] { size } else { largest[i] };
        }
    }

    fn viscosity_row(&mut self, mesh: &Mesh, j: usize, dt: f64) {
        let (n, at) = (mesh.nz, j * mesh.nz);
        let (rate, speed) = (&self.rate[at..][..n], &self.speed[at..][..n]);
        let (linear, quadratic) = (&self.linear[at..][..n], &self.quadratic[at..][..n]);
        let (ceiling, volume) = (&self.ceiling[at..][..n], &mesh.volume[at..][..n]);
        let q = &mut self.viscous_pressure[at..][..n];
        let loss = &mut self.viscous_loss[at..][..n];
        for i in 0..n {
            let d = rate[i];
            let squeeze = if d < 0.0 { -d } else { 0.0 };
            let wanted = linear[i] + quadratic[i] * squeeze;
            let viscosity = if wanted < ceiling[i] { wanted } else { ceiling[i] };
            let new = -speed[i] * viscosity * d;
            loss[i] -= 0.5 * (q[i] + new) * d * dt * volume[i];
            q[i] = new;
        }
        let longest = &mut self.longest_saturation[at..][..n];
        let saturation = &mut self.saturation[at..][..n];
        for i in 0..n {
            saturation[i] = (saturation[i] + dt) * cavitated(speed[i]);
            longest[i] = if saturation[i] > longest[i] { saturation[i] } else { longest[i] };
        }
    }

    fn hourglass_row(&mut self, mesh: &Mesh, velocity: &Field, j: usize, dt: f64) {
        let (n, at) = (mesh.nz, j * mesh.nz);
        let [r0, r1, r2, r3] = corners(mesh, &velocity.fluid_r, j);
        let [z0, z1, z2, z3] = corners(mesh, &velocity.fluid_z, j);
        let [g0, g1, g2, g3] = weights(mesh, &mesh.gamma, j);
        let resistance = &self.resistance[at..][..n];
        let hr = &mut self.hourglass_r[at..][..n];
        let hz = &mut self.hourglass_z[at..][..n];
        let loss = &mut self.hourglass_loss[at..][..n];
        for i in 0..n {
            let rate_r = g0[i] * r0[i] + g1[i] * r1[i] + g2[i] * r2[i] + g3[i] * r3[i];
            let rate_z = g0[i] * z0[i] + g1[i] * z1[i] + g2[i] * z2[i] + g3[i] * z3[i];
            let (new_r, new_z) = (-resistance[i] * rate_r, -resistance[i] * rate_z);
            loss[i] -= 0.5 * dt * ((hr[i] + new_r) * rate_r + (hz[i] + new_z) * rate_z);
            hr[i] = new_r;
            hz[i] = new_z;
        }
    }

    /// Writes the nodal forces `(p + q) B + γh`, N.
    pub fn forces(&self, mesh: &Mesh, force: &mut Field) {
        spread(mesh, self, &mesh.b_r, &self.hourglass_r, &mut force.fluid_r);
        spread(mesh, self, &mesh.b_z, &self.hourglass_z, &mut force.fluid_z);
    }

    /// Energy stored in the fluid, J.
    pub fn stored_energy(&self, mesh: &Mesh) -> f64 {
        let cells = mesh.volume.iter().zip(&self.strain).enumerate();
        cells.map(|(cell, (&v, &strain))| v * self.eos.stored_energy(cell, strain)).sum()
    }

    /// Energy that the equation of state has converted to heat so far, J.
    pub fn lost_energy(&self, mesh: &Mesh) -> f64 {
        mesh.volume.iter().enumerate().map(|(cell, v)| v * self.eos.lost_energy(cell)).sum()
    }

    /// Volume fraction of the fluid at the cutoff, between 0 and 1.
    pub fn cavitated_fraction(&self, mesh: &Mesh) -> f64 {
        let volume: f64 = mesh.volume.iter().sum();
        mesh.volume.iter().zip(&self.speed).map(|(v, &speed)| v * cavitated(speed)).sum::<f64>()
            / volume
    }
}

/// 1 at zero wave speed, else 0.
fn cavitated(speed: f64) -> f64 {
    if speed == 0.0 { 1.0 } else { 0.0 }
}

/// Writes one component of the nodal forces, N.
fn spread<E>(mesh: &Mesh, fluid: &Fluid<E>, b: &Corner, hourglass: &[f64], force: &mut [f64]) {
    let (n, row) = (mesh.nz, mesh.nz + 1);
    force.fill(0.0);
    for j in 0..mesh.nr {
        let at = j * n;
        let p = &fluid.pressure[at..][..n];
        let q = &fluid.viscous_pressure[at..][..n];
        let h = &hourglass[at..][..n];
        let b = weights(mesh, b, j);
        let g = weights(mesh, &mesh.gamma, j);
        let starts = [j * row, (j + 1) * row, (j + 1) * row + 1, j * row + 1];
        for (k, start) in starts.into_iter().enumerate() {
            let (b, g, force) = (b[k], g[k], &mut force[start..][..n]);
            for i in 0..n {
                force[i] += (p[i] + q[i]) * b[i] + g[i] * h[i];
            }
        }
    }
}
