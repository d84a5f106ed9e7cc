//! Conserved quantities (energy, momentum), time reversal, scaling, and grid convergence.

use super::*;

fn coarse() -> Settings {
    let mut settings = Settings::default();
    settings.numerics.mesh = Cells::Explicit([10, 45]);
    settings
}

fn undamped(cfl: f64) -> Settings {
    let mut settings = coarse();
    let numerics = &mut settings.numerics;
    (numerics.linear_viscosity, numerics.quadratic_viscosity) = (0.0, 0.0);
    (numerics.hourglass, numerics.cfl, numerics.rear) = (0.0, cfl, Rear::Rigid);
    settings
}

fn largest(strain: &Outcome) -> f64 {
    strain.strain.iter().flatten().fold(0.0, |largest, x| x.abs().max(largest))
}

#[test]
fn linear_runs_conserve_energy_to_rounding() {
    let mercury = Mercury { tensile_cutoff: 1e12, ..RIEMER };
    let energy = simulate(&undamped(0.9), &mercury).unwrap().energy;
    assert!(energy.imbalance().abs() < 1e-11, "{energy:?}");
    assert_eq!(energy.viscous + energy.hourglass + energy.radiated, 0.0);
}

#[test]
fn cavitating_runs_conserve_energy_up_to_the_kink() {
    // A cell that crosses the cutoff within a step has an error proportional to the square of the step.
    let error = |cfl| {
        let energy = simulate(&undamped(cfl), &RIEMER).unwrap().energy;
        energy.imbalance().abs()
    };
    let (long, short) = (error(0.8), error(0.2));
    assert!(long < 0.02 && short < 0.005, "{long} {short}");
}

#[test]
fn every_loss_of_a_default_run_is_accounted_for() {
    for sound_speed in [1456.0, 5000.0] {
        let outcome = simulate(&coarse(), &Mercury { sound_speed, ..RIEMER }).unwrap();
        let energy = outcome.energy;
        assert!(energy.imbalance().abs() < 0.015, "{energy:?}");
        assert!(energy.viscous > 0.0 && energy.hourglass > 0.0 && energy.radiated > 0.0);
    }
    let linear = Mercury { tensile_cutoff: 1e12, ..RIEMER };
    let energy = simulate(&coarse(), &linear).unwrap().energy;
    assert!(energy.imbalance().abs() < 1e-10, "{energy:?}");
}

/// A run on the coarse mesh, step by step.
fn by_hand(target: &Target, constants: FluidConstants, cutoff: f64) -> Solver<'_, TensileCutoff> {
    let vessel = target.vessel();
    let (geometry, pulse) = (Geometry::default(), Pulse::default());
    let shape = |[r, z]: [f64; 2]| pulse.peak_pressure * pulse.shape(&geometry, r, z);
    let initial = vessel.mesh.centres().map(shape).collect();
    let eos = TensileCutoff::new(constants.density, RIEMER.sound_speed, cutoff, initial);
    let dt = 0.7 * vessel.stable_step(RIEMER.sound_speed, constants.linear_viscosity);
    Solver::new(vessel, constants, eos, dt)
}

#[test]
fn axial_momentum_changes_by_the_reactions_of_the_rear() {
    let target = Target::new(&undamped(0.7)).unwrap();
    let constants = FluidConstants {
        linear_viscosity: 0.25,
        quadratic_viscosity: 1.2,
        hourglass: 0.01,
        ..INVISCID
    };
    let mut solver = by_hand(&target, constants, RIEMER.tensile_cutoff);
    let vessel = target.vessel();
    let dt = 0.7 * vessel.stable_step(RIEMER.sound_speed, 0.25);
    let mesh = &vessel.mesh;
    let (mut impulse, mut size) = (0.0, 0.0);
    for step in 0..600 {
        // Held motions keep their forces; the reactions balance them.
        let force = solver.force();
        let fluid: f64 = (0..=mesh.nr).map(|j| force.fluid_z[mesh.node(mesh.nz, j)]).sum();
        let wall = force.shell_z[vessel.shell.nodes() - 1];
        let dt = if step == 0 { 0.5 * dt } else { dt };
        impulse -= dt * (fluid + wall);
        size += dt * (fluid + wall).abs();
        solver.step();
    }
    let mass = solver.mass();
    let part = |m: &[f64], v: &[f64]| m.iter().zip(v).map(|(m, v)| m * v).sum::<f64>();
    let momentum = part(&mass.fluid_z, &solver.velocity.fluid_z)
        + part(&mass.shell_z, &solver.velocity.shell_z);
    assert!(solver.fluid.longest_saturation.iter().any(|&time| time > 1e-4));
    assert!((momentum - impulse).abs() < 1e-10 * size, "{momentum} {impulse}");
}

#[test]
fn an_end_that_reflects_more_comes_closer_to_a_rigid_one() {
    let mercury = Mercury { tensile_cutoff: 1e12, ..RIEMER };
    let strain = |settings: &Settings| simulate(settings, &mercury).unwrap();
    let mut rigid = coarse();
    rigid.numerics.rear = Rear::Rigid;
    let rigid = strain(&rigid);
    let distance = |reflection: f64| {
        let outcome = strain(&Settings { rear_reflection: reflection, ..coarse() });
        let pairs = outcome.strain.iter().flatten().zip(rigid.strain.iter().flatten());
        pairs.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs())) / largest(&rigid)
    };
    let [none, half, nearly] = [0.0, 0.5, 0.999].map(distance);
    assert!(none > half && half > 10.0 * nearly && nearly < 0.02, "{none} {half} {nearly}");
}

#[test]
fn undamped_uncavitated_motion_runs_backwards() {
    let target = Target::new(&undamped(0.7)).unwrap();
    let mut solver = by_hand(&target, INVISCID, 1e12);
    for _ in 0..500 {
        solver.step();
    }
    let moved = solver.fluid.strain.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    // After a step the velocity is half a step old: its reversal leads one step back at once.
    for part in solver.velocity.parts_mut() {
        for v in part {
            *v = -*v;
        }
    }
    solver.drift();
    for _ in 1..500 {
        solver.step();
    }
    let left = solver.fluid.strain.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    assert!(moved > 1e-4 && left < 1e-10 * moved, "{left} {moved}");
}

#[test]
fn strains_are_proportional_to_load_and_cutoff_together() {
    // Without quadratic viscosity and thermal strain of the wall the equations are homogeneous.
    let mut settings = coarse();
    settings.numerics.quadratic_viscosity = 0.0;
    settings.pulse.wall_strain = 0.0;
    let mut doubled = settings.clone();
    doubled.pulse.peak_pressure *= 2.0;
    let small = simulate(&settings, &RIEMER).unwrap();
    let cutoff = 2.0 * RIEMER.tensile_cutoff;
    let large = simulate(&doubled, &Mercury { tensile_cutoff: cutoff, ..RIEMER }).unwrap();
    for (x, y) in small.strain.iter().flatten().zip(large.strain.iter().flatten()) {
        assert!((2.0 * x - y).abs() < 1e-9 * largest(&large));
    }
}

#[test]
fn strains_do_not_change_when_all_stiffnesses_masses_and_loads_grow() {
    let mut settings = coarse();
    settings.pulse.load = Load::FixedPressure;
    let mut heavier = settings.clone();
    heavier.pulse.peak_pressure *= 2.0;
    heavier.wall.young_modulus *= 2.0;
    heavier.wall.density *= 2.0;
    let mercury = Mercury {
        density: 2.0 * RIEMER.density,
        tensile_cutoff: 2.0 * RIEMER.tensile_cutoff,
        ..RIEMER
    };
    let (a, b) = (simulate(&settings, &RIEMER).unwrap(), simulate(&heavier, &mercury).unwrap());
    assert!(rms_difference(&a, &b) < 1e-9 * rms(&a));
}

#[test]
fn strains_do_not_change_with_the_unit_of_length_and_time() {
    let settings = coarse();
    let mut larger = settings.clone();
    let (g, w, p) = (&mut larger.geometry, &mut larger.wall, &mut larger.pulse);
    for length in [
        &mut g.radius,
        &mut g.length,
        &mut g.cap_radius,
        &mut w.cap_thickness,
        &mut w.cylinder_thickness,
        &mut p.width,
        &mut p.rise,
        &mut p.decay,
        &mut larger.sampling.interval,
    ] {
        *length *= 2.0;
    }
    for gauge in &mut larger.gauges.0 {
        gauge.position *= 2.0;
        gauge.length *= 2.0;
    }
    let (a, b) = (simulate(&settings, &RIEMER).unwrap(), simulate(&larger, &RIEMER).unwrap());
    assert!(rms_difference(&a, &b) < 1e-9 * rms(&a));
}

/// Observed order from 10 x 45, 20 x 90 and 40 x 180 cells, and the last difference, microstrain.
fn convergence(cutoff: f64) -> (f64, f64) {
    let run = |n: usize| {
        let mut settings = Settings::default();
        settings.numerics.mesh = Cells::Explicit([n, n * 9 / 2]);
        simulate(&settings, &Mercury { tensile_cutoff: cutoff, ..RIEMER }).unwrap()
    };
    let [a, b, c] = [10, 20, 40].map(run);
    let (first, second) = (rms_difference(&a, &b), rms_difference(&b, &c));
    ((first / second).log2(), second * 1e6)
}

#[test]
fn traces_converge_with_the_mesh() {
    // Bounds around the results of an independent prototype of the same equations: order about 1 to 1.35 without and
    // 0.5 to 0.8 with cavitation, where the closure of cavities is chaotic. The linear viscosity, proportional to the
    // cell size, is of first order.
    let (order, last) = convergence(1e12);
    assert!(order > 0.7 && last < 9.0, "{order} {last}");
    let (order, last) = convergence(RIEMER.tensile_cutoff);
    assert!(order > 0.4 && last < 12.0, "{order} {last}");
}

#[test]
fn nothing_happens_without_a_pulse() {
    let mut settings = coarse();
    settings.pulse.peak_pressure = 0.0;
    settings.pulse.wall_strain = 0.0;
    let outcome = simulate(&settings, &RIEMER).unwrap();
    assert_eq!(largest(&outcome), 0.0);
    assert_eq!(outcome.saturation_time, 0.0);
}

#[test]
fn tiny_changes_of_the_mercury_change_the_traces_little() {
    // The closure of cavities is chaotic: scatter of about 1 microstrain on rms traces of about 100.
    let target = Target::new(&Settings::default()).unwrap();
    let base = target.simulate(&RIEMER).unwrap();
    for factor in [0.999, 1.001] {
        let mercury = Mercury { density: RIEMER.density * factor, ..RIEMER };
        let change = rms_difference(&base, &target.simulate(&mercury).unwrap());
        assert!(change < 3e-6, "{change}");
    }
}

/// The production law as another type.
#[derive(Clone)]
struct Wrapped(TensileCutoff);

impl EquationOfState for Wrapped {
    fn update(&mut self, first: usize, strain: &[f64], dt: f64, p: &mut [f64], speed: &mut [f64]) {
        self.0.update(first, strain, dt, p, speed);
    }

    fn sound_speed(&self) -> f64 {
        self.0.sound_speed()
    }

    fn stored_energy(&self, cell: usize, strain: f64) -> f64 {
        self.0.stored_energy(cell, strain)
    }
}

#[test]
fn another_equation_of_state_shares_the_solver() {
    let target = Target::new(&coarse()).unwrap();
    let Mercury { density, sound_speed, tensile_cutoff } = RIEMER;
    let initial = target.initial_pressure(&RIEMER);
    let law = Wrapped(TensileCutoff::new(density, sound_speed, tensile_cutoff, initial));
    assert_eq!(target.run(density, law).unwrap(), target.simulate(&RIEMER).unwrap());
}
