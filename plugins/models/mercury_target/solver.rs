//! The leapfrog that joins fluid and wall.

use super::coupling::{Field, Held, Joints, Motion};
use super::eos::EquationOfState;
use super::fluid::{self, Fluid, FluidConstants};
use super::mesh::Mesh;
use super::shell::Shell;

/// A vessel before a material fills it: what every run shares.
#[derive(Debug, Clone)]
pub struct Vessel {
    /// Mesh of the fluid.
    pub mesh: Mesh,
    /// Wall at rest.
    pub shell: Shell,
    /// Motions held at zero.
    pub held: Held,
    /// Contacts, plate and open end.
    pub joints: Joints,
}

impl Vessel {
    /// Longest stable time step, s. The frequencies of the coupled system lie below the larger
    /// of the parts' (Rayleigh quotient), so that the contact adds no limit.
    pub fn stable_step(&self, sound_speed: f64, linear_viscosity: f64) -> f64 {
        let fluid = fluid::stable_step(&self.mesh, sound_speed, linear_viscosity);
        fluid.min(self.shell.stable_step(&self.held.shell))
    }
}

/// Where the energy is, in J.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct EnergyBalance {
    /// Energy at the start: stored in fluid and wall, and kinetic.
    pub start: f64,
    /// Kinetic energy.
    pub kinetic: f64,
    /// Energy stored in the fluid.
    pub fluid: f64,
    /// Energy stored in the wall.
    pub wall: f64,
    /// Lost to the artificial viscosity.
    pub viscous: f64,
    /// Lost to the hourglass control.
    pub hourglass: f64,
    /// Gone through the open rear end.
    pub radiated: f64,
    /// Lost to the damping.
    pub damped: f64,
    /// Turned into heat by the equation of state.
    pub relaxed: f64,
}

impl EnergyBalance {
    /// Energy that appeared from nowhere, relative to the sum of the sizes of all entries.
    pub fn imbalance(&self) -> f64 {
        let stored = [self.kinetic, self.fluid, self.wall];
        let lost = [self.viscous, self.hourglass, self.radiated, self.damped, self.relaxed];
        let now = || stored.iter().chain(&lost);
        let size = self.start.abs() + now().map(|e| e.abs()).sum::<f64>();
        if size == 0.0 { 0.0 } else { (now().sum::<f64>() - self.start) / size }
    }
}

/// A run: positions at whole steps, velocities at half steps.
#[derive(Debug, Clone)]
pub struct Solver<'a, E> {
    /// The fluid.
    pub fluid: Fluid<E>,
    /// The wall.
    pub shell: Shell,
    /// Velocities half a step before the present (before the first step: at the start).
    pub velocity: Field,
    /// Completed steps.
    pub steps: usize,
    /// Decay of all motion in proportion to its mass, 1/s.
    pub damping: f64,
    vessel: &'a Vessel,
    motion: Motion,
    force: Field,
    dt: f64,
    start: f64,
    radiated: f64,
    damped: f64,
}

impl<'a, E: EquationOfState + Clone> Solver<'a, E> {
    /// A fluid at rest in the vessel, just after the pulse.
    pub fn new(vessel: &'a Vessel, constants: FluidConstants, eos: E, dt: f64) -> Self {
        let Vessel { mesh, shell, held, joints } = vessel;
        let impedance = constants.density * eos.sound_speed();
        let fluid = Fluid::new(mesh, constants, eos, dt);
        let mut mass = Field::zeros(mesh.r.len(), shell.nodes());
        for part in [&mut mass.fluid_r, &mut mass.fluid_z] {
            part.clone_from(&mesh.node_volume);
            for m in part {
                *m *= constants.density;
            }
        }
        shell.add_masses(&mut mass);
        let motion = Motion::new(mass, &mesh.area(), held, joints, impedance);
        let zeros = Field::zeros(mesh.r.len(), shell.nodes());
        let mut solver = Self {
            start: fluid.stored_energy(mesh) + fluid.lost_energy(mesh) + shell.stored_energy(),
            fluid,
            shell: shell.clone(),
            velocity: zeros.clone(),
            steps: 0,
            damping: 0.0,
            vessel,
            motion,
            force: zeros,
            dt,
            radiated: 0.0,
            damped: 0.0,
        };
        solver.update_forces();
        solver
    }

    /// One time step.
    pub fn step(&mut self) {
        if self.steps == 0 {
            self.first_kick();
        } else {
            self.full_kick();
        }
        self.drift();
        self.steps += 1;
    }

    /// Positions one step on with the present velocities, and the forces there.
    pub fn drift(&mut self) {
        self.fluid.advance(&self.vessel.mesh, &self.velocity, self.dt);
        self.shell.advance(&self.velocity, self.dt);
        self.update_forces();
    }

    fn full_kick(&mut self) {
        let mut velocity = std::mem::take(&mut self.velocity);
        let before = (self.damping != 0.0).then(|| velocity.clone());
        self.radiated += self.kick(&mut velocity);
        if let Some(mut mean) = before {
            average(&mut mean, &velocity);
            self.damped += self.dt * self.damped_power(&mean, &mean);
        }
        self.velocity = velocity;
    }

    /// The velocities a step on; the damping acts on the mean of old and new ones: stable for
    /// any step. Returns the energy radiated, J.
    fn kick(&self, velocity: &mut Field) -> f64 {
        if self.damping == 0.0 {
            return self.motion.kick(velocity, &self.force, self.dt);
        }
        let half = 0.5 * self.damping * self.dt;
        scale(velocity, (1.0 - half) / (1.0 + half));
        self.motion.kick(velocity, &self.force, self.dt / (1.0 + half))
    }

    /// Power that the damping takes from a velocity, tested with another one, W.
    fn damped_power(&self, velocity: &Field, test: &Field) -> f64 {
        2.0 * self.damping * self.motion.kinetic(velocity, test)
    }

    /// From the start to half a step later. The energy that the leapfrog conserves counts the
    /// product of the velocities half a step before and after the start.
    fn first_kick(&mut self) {
        let mut before = self.velocity.clone();
        scale(&mut self.velocity, 1.0 - 0.5 * self.damping * self.dt);
        self.motion.kick(&mut self.velocity, &self.force, 0.5 * self.dt);
        self.damped += 0.5 * self.dt * self.damped_power(&before, &self.velocity);
        let power = self.motion.radiated_power(&self.velocity, &before);
        self.radiated += 0.5 * self.dt * power;
        for (v, after) in before.parts_mut().into_iter().zip(self.velocity.parts()) {
            for (v, after) in v.iter_mut().zip(after) {
                *v = 2.0 * *v - after;
            }
        }
        self.start += self.motion.kinetic(&before, &self.velocity);
    }

    fn update_forces(&mut self) {
        self.fluid.forces(&self.vessel.mesh, &mut self.force);
        self.shell.forces(&mut self.force);
    }

    /// Present forces on every motion, N (N m for rotations).
    pub fn force(&self) -> &Field {
        &self.force
    }

    /// Masses of every motion, kg (kg m² for rotations).
    pub fn mass(&self) -> &Field {
        &self.motion.mass
    }

    /// Whether all strains of the fluid and displacements of the wall are finite.
    pub fn is_finite(&self) -> bool {
        let total = |x: &[f64]| x.iter().map(|x| x.abs()).sum::<f64>();
        (total(&self.fluid.strain) + total(&self.shell.r) + total(&self.shell.z)).is_finite()
    }

    /// The energy balance now. The kinetic energy is the product of the velocities half a step
    /// before and after, which the leapfrog conserves exactly together with the stored energy
    /// as long as the pressure is linear in the strain.
    pub fn energy(&self) -> EnergyBalance {
        let mut after = self.velocity.clone();
        if self.steps > 0 {
            self.kick(&mut after);
        }
        let mut mean = after.clone();
        average(&mut mean, &self.velocity);
        let damped = self.damped + 0.5 * self.dt * self.damped_power(&mean, &self.velocity);
        let kinetic = self.motion.kinetic(&self.velocity, &after);
        let mesh = &self.vessel.mesh;
        let now = 0.5 * self.dt * self.motion.radiated_power(&self.velocity, &after);
        EnergyBalance {
            start: self.start,
            kinetic,
            fluid: self.fluid.stored_energy(mesh),
            wall: self.shell.stored_energy(),
            viscous: self.fluid.viscous_loss.iter().sum(),
            hourglass: self.fluid.hourglass_loss.iter().sum(),
            radiated: self.radiated + now,
            damped,
            relaxed: self.fluid.lost_energy(mesh),
        }
    }
}

fn scale(field: &mut Field, factor: f64) {
    for x in field.parts_mut().into_iter().flatten() {
        *x *= factor;
    }
}

/// The mean of two fields, in the place of the first.
fn average(field: &mut Field, other: &Field) {
    for (x, y) in field.parts_mut().into_iter().zip(other.parts()) {
        for (x, y) in x.iter_mut().zip(y) {
            *x = 0.5 * (*x + y);
        }
    }
}
