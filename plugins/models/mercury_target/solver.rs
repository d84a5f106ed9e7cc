//! Leapfrog integration of fluid and wall together.

use super::coupling::{Field, Held, Joints, Motion};
use super::eos::EquationOfState;
use super::fluid::{self, Fluid, FluidConstants};
use super::mesh::Mesh;
use super::shell::Shell;

/// The vessel without its content: everything that is the same for all runs.
#[derive(Debug, Clone)]
pub struct Vessel {
    /// Mesh of the fluid.
    pub mesh: Mesh,
    /// Wall at rest.
    pub shell: Shell,
    /// Motions held at zero.
    pub held: Held,
    /// Contacts, plate and absorbing end.
    pub joints: Joints,
}

impl Vessel {
    /// Longest stable time step, s. By Rayleigh's quotient the frequencies of the coupled system do not exceed the
    /// larger of the two parts' highest frequencies, so that the contact adds no limit.
    pub fn stable_step(&self, sound_speed: f64, linear_viscosity: f64) -> f64 {
        let fluid = fluid::stable_step(&self.mesh, sound_speed, linear_viscosity);
        fluid.min(self.shell.stable_step(&self.held.shell))
    }
}

/// Terms of the energy balance, J.
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
    /// Energy lost to the artificial viscosity.
    pub viscous: f64,
    /// Energy lost to the hourglass control.
    pub hourglass: f64,
    /// Energy that left through the absorbing rear end.
    pub radiated: f64,
    /// Energy lost to the damping.
    pub damped: f64,
    /// Energy that the equation of state has converted to heat.
    pub relaxed: f64,
}

impl EnergyBalance {
    /// Error of the balance: the sum of all terms minus the energy at the start, divided by the sum of the magnitudes
    /// of all terms.
    pub fn imbalance(&self) -> f64 {
        let stored = [self.kinetic, self.fluid, self.wall];
        let lost = [self.viscous, self.hourglass, self.radiated, self.damped, self.relaxed];
        let now = || stored.iter().chain(&lost);
        let size = self.start.abs() + now().map(|e| e.abs()).sum::<f64>();
        if size == 0.0 { 0.0 } else { (now().sum::<f64>() - self.start) / size }
    }
}

/// State of a run: positions at whole steps, velocities at half steps.
#[derive(Debug, Clone)]
pub struct Solver<'a, E> {
    /// The fluid.
    pub fluid: Fluid<E>,
    /// The wall.
    pub shell: Shell,
    /// Velocities half a step before the current time; before the first step, velocities at the start.
    pub velocity: Field,
    /// Number of completed steps.
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
    /// A fluid at rest in the vessel, just after the pulse; `dt` is the time step, s.
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

    /// Advances by one time step.
    pub fn step(&mut self) {
        if self.steps == 0 {
            self.first_kick();
        } else {
            self.full_kick();
        }
        self.drift();
        self.steps += 1;
    }

    /// Advances the positions by one step with the current velocities, and evaluates the forces there.
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

    /// Advances the velocities by one step. The damping acts on the mean of the old and the new velocities, which is
    /// stable for any step. Returns the energy radiated, J.
    fn kick(&self, velocity: &mut Field) -> f64 {
        if self.damping == 0.0 {
            return self.motion.kick(velocity, &self.force, self.dt);
        }
        let half = 0.5 * self.damping * self.dt;
        scale(velocity, (1.0 - half) / (1.0 + half));
        self.motion.kick(velocity, &self.force, self.dt / (1.0 + half))
    }

    /// Power that the damping takes from a velocity, projected on another one, W.
    fn damped_power(&self, velocity: &Field, test: &Field) -> f64 {
        2.0 * self.damping * self.motion.kinetic(velocity, test)
    }

    /// Advances the velocities from the start by half a step. The energy that the leapfrog conserves contains the
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

    /// Current force on every motion, N (N m for rotations).
    pub fn force(&self) -> &Field {
        &self.force
    }

    /// Mass of every motion, kg (kg m² for rotations).
    pub fn mass(&self) -> &Field {
        &self.motion.mass
    }

    /// Returns `true` if all strains of the fluid and displacements of the wall are finite.
    pub fn is_finite(&self) -> bool {
        let total = |x: &[f64]| x.iter().map(|x| x.abs()).sum::<f64>();
        (total(&self.fluid.strain) + total(&self.shell.r) + total(&self.shell.z)).is_finite()
    }

    /// The current energy balance. The kinetic energy is the product of the velocities half a step before and after,
    /// which the leapfrog conserves exactly together with the stored energy as long as the pressure is linear in the
    /// strain.
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

/// Replaces the first field by the mean of both.
fn average(field: &mut Field, other: &Field) {
    for (x, y) in field.parts_mut().into_iter().zip(other.parts()) {
        for (x, y) in x.iter_mut().zip(y) {
            *x = 0.5 * (*x + y);
        }
    }
}
