//! The vessel that the settings describe, and complete runs.

use super::coupling::{Contact, Held, Joints};
use super::eos::{EquationOfState, TensileCutoff};
use super::fluid::FluidConstants;
use super::gas::{Bubbly, Gas};
use super::gauges::{Meridian, Sensor};
use super::mesh::Mesh;
use super::settings::{Rear, Settings};
use super::shell::{Element, Shell, Steel};
use super::solver::{Solver, Vessel};
use super::{Mercury, Outcome, SimulationError, load};

/// Limit on the number of steps of a run; a run that needs more fails.
const MOST_STEPS: f64 = 5e6;

/// Magnitude of the volumetric strain from which the linear kinematics are invalid.
const VALID_STRAIN: f64 = 0.1;

/// The model prepared for any number of runs: mesh, wall and gauges.
#[derive(Debug, Clone)]
pub struct Target {
    settings: Settings,
    vessel: Vessel,
    shapes: Vec<f64>,
    sensors: Vec<Sensor>,
}

/// Builds mesh, wall and gauges, and makes one run.
pub fn simulate(settings: &Settings, mercury: &Mercury) -> Result<Outcome, SimulationError> {
    Target::new(settings)?.simulate(mercury)
}

impl Target {
    /// Checks the settings and builds mesh, wall and gauges.
    pub fn new(settings: &Settings) -> Result<Self, SimulationError> {
        settings.validate()?;
        let mesh = mesh(settings);
        let wall: Vec<usize> = wall_nodes(&mesh);
        let nodes: Vec<[f64; 2]> = wall.iter().map(|&n| [mesh.r[n], mesh.z[n]]).collect();
        let meridian = Meridian { nodes: &nodes, rim: mesh.nr };
        let sensors = settings.gauges.0.iter().map(|g| Sensor::new(g, meridian)).collect();
        let shapes = load::cell_shapes(&mesh, &settings.geometry, &settings.pulse);
        let vessel = Vessel {
            shell: shell(settings, meridian),
            held: held(&mesh, wall.len(), settings.numerics.rear),
            joints: joints(&mesh, &wall, settings),
            mesh,
        };
        Ok(Self { settings: settings.clone(), vessel, shapes, sensors })
    }

    /// Mesh, wall and contacts.
    pub fn vessel(&self) -> &Vessel {
        &self.vessel
    }

    /// The gauges, in the order of the settings.
    pub fn sensors(&self) -> &[Sensor] {
        &self.sensors
    }

    /// Strain traces after one pulse in the given mercury.
    pub fn simulate(&self, mercury: &Mercury) -> Result<Outcome, SimulationError> {
        mercury.validate()?;
        let initial = self.initial_pressure(mercury);
        let Mercury { density, sound_speed, tensile_cutoff } = *mercury;
        self.run(density, TensileCutoff::new(density, sound_speed, tensile_cutoff, initial))
    }

    /// Strain traces after one pulse in mercury with gas bubbles.
    pub fn simulate_with_gas(
        &self,
        mercury: &Mercury,
        gas: &Gas,
    ) -> Result<Outcome, SimulationError> {
        mercury.validate()?;
        gas.validate()?;
        let Mercury { density, sound_speed, tensile_cutoff } = *mercury;
        let initial = self.initial_pressure(mercury);
        let liquid = TensileCutoff::new(density, sound_speed, tensile_cutoff, initial);
        let centres = self.vessel.mesh.centres();
        let share = centres.map(|[r, z]| gas.share(&self.settings.geometry, r, z)).collect();
        self.run(density, Bubbly::new(liquid, gas.bubbles(density), share))
    }

    /// Pressure in each cell after the pulse in the given mercury, Pa.
    pub fn initial_pressure(&self, mercury: &Mercury) -> Vec<f64> {
        let peak = self.settings.pulse.pressure(mercury);
        self.shapes.iter().map(|shape| peak * shape).collect()
    }

    /// A run with any equation of state. `density` is that of the fluid, kg/m³. Fails if the run would need too many
    /// steps or a strain is not finite.
    pub fn run<E: EquationOfState + Clone>(
        &self,
        density: f64,
        eos: E,
    ) -> Result<Outcome, SimulationError> {
        let (numerics, sampling) = (&self.settings.numerics, &self.settings.sampling);
        let stable = self.vessel.stable_step(eos.sound_speed(), numerics.linear_viscosity);
        let substeps = (sampling.interval / (numerics.cfl * stable)).ceil().max(1.0);
        let steps = substeps * sampling.count as f64;
        if steps.is_nan() || steps > MOST_STEPS {
            return Err(SimulationError::TooManySteps { steps });
        }
        let constants = FluidConstants {
            density,
            linear_viscosity: numerics.linear_viscosity,
            quadratic_viscosity: numerics.quadratic_viscosity,
            hourglass: numerics.hourglass,
        };
        let mut solver = Solver::new(&self.vessel, constants, eos, sampling.interval / substeps);
        solver.damping = self.settings.damping;
        let mut outcome = Outcome::empty(self.sensors.len(), sampling.count);
        for output in 1..=sampling.count {
            for _ in 0..substeps as usize {
                solver.step();
            }
            self.record(&solver, output as f64 * sampling.interval, &mut outcome)?;
        }
        let largest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        outcome.largest_volumetric_strain = largest(&solver.fluid.largest_strain);
        outcome.valid = outcome.largest_volumetric_strain < VALID_STRAIN;
        outcome.saturation_time = largest(&solver.fluid.longest_saturation);
        outcome.energy = solver.energy();
        outcome.steps = solver.steps;
        Ok(outcome)
    }

    fn record<E: EquationOfState + Clone>(
        &self,
        solver: &Solver<'_, E>,
        time: f64,
        outcome: &mut Outcome,
    ) -> Result<(), SimulationError> {
        if !solver.is_finite() {
            return Err(SimulationError::NotFinite { time });
        }
        outcome.times.push(time);
        outcome.cavitated_fraction.push(solver.fluid.cavitated_fraction(&self.vessel.mesh));
        for (sensor, trace) in self.sensors.iter().zip(&mut outcome.strain) {
            let strain = sensor.read(&solver.shell);
            if !strain.is_finite() {
                return Err(SimulationError::NotFinite { time });
            }
            trace.push(strain);
        }
        Ok(())
    }
}

/// The mesh: its rows are parallel to the axis, and axial positions run from the cap to the rear.
fn mesh(settings: &Settings) -> Mesh {
    let [nr, nz] = settings.numerics.mesh.counts();
    let geometry = &settings.geometry;
    Mesh::new(nr, nz, |i, j| {
        let r = geometry.radius * j as f64 / nr as f64;
        let back = i as f64 / nz as f64;
        [r, geometry.nose(r) * (1.0 - back) + geometry.length * back]
    })
}

/// Fluid nodes along the wall: the cap from its apex, then the cylinder.
fn wall_nodes(mesh: &Mesh) -> Vec<usize> {
    let cap = (0..mesh.nr).map(|j| mesh.node(0, j));
    cap.chain((0..=mesh.nz).map(|i| mesh.node(i, mesh.nr))).collect()
}

fn shell(settings: &Settings, meridian: Meridian<'_>) -> Shell {
    let wall = &settings.wall;
    let steel = Steel {
        young_modulus: wall.young_modulus,
        poisson_ratio: wall.poisson_ratio,
        density: wall.density,
    };
    let element = |(s, ends): (usize, &[[f64; 2]])| {
        let (thickness, eigenstrain) = if s < meridian.rim {
            let r = 0.5 * (ends[0][0] + ends[1][0]);
            (wall.cap_thickness, settings.pulse.wall_strain * settings.pulse.across(r))
        } else {
            (wall.cylinder_thickness, 0.0)
        };
        Element::new(ends[0], ends[1], thickness, steel, eigenstrain)
    };
    Shell::new(meridian.nodes.windows(2).enumerate().map(element).collect())
}

/// Held motions: the axis by symmetry, the wall by its clamp at the rear.
fn held(mesh: &Mesh, wall_nodes: usize, rear: Rear) -> Held {
    let mut held =
        Held { fluid: vec![[false; 2]; mesh.r.len()], shell: vec![[false; 3]; wall_nodes] };
    for i in 0..=mesh.nz {
        held.fluid[mesh.node(i, 0)][0] = true;
    }
    for j in 0..=mesh.nr {
        held.fluid[mesh.node(mesh.nz, j)][1] = rear == Rear::Rigid;
    }
    held.fluid[mesh.node(mesh.nz, mesh.nr)][0] = true;
    held.shell[0] = [true, false, true];
    held.shell[wall_nodes - 1] = [true; 3];
    held
}

fn joints(mesh: &Mesh, wall: &[usize], settings: &Settings) -> Joints {
    let contact = |(s, &n): (usize, &usize)| {
        (n, s, if s == mesh.nr { Contact::Stick } else { Contact::Slip })
    };
    let open_end = match settings.numerics.rear {
        Rear::Absorbing => (0..=mesh.nr).map(|j| mesh.node(mesh.nz, j)).collect(),
        Rear::Rigid => Vec::new(),
    };
    let contacts = wall[..wall.len() - 1].iter().enumerate().map(contact).collect();
    Joints { contacts, plate: None, open_end, reflection: settings.rear_reflection }
}
