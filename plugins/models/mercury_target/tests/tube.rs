//! The fluid-filled elastic tube.

use std::f64::consts::PI;

use super::*;

const RADIUS: f64 = 0.1;
const THICKNESS: f64 = 5e-3;
const PLANE: f64 = 193e9 / (1.0 - 0.3 * 0.3);

/// Breathing modes of an infinitely long filled tube: `(K/a) x J₀(x) + (Eh/((1-ν²)a²) - ρ_s h (xc/a)²) J₁(x) = 0`,
/// `f = xc/(2πa)`. In this equation the fluid's pressure `p = P J₀(xr/a)` drives the wall's ring equation.
fn breathing(low: f64, high: f64) -> f64 {
    let (a, h, c) = (RADIUS, THICKNESS, RIEMER.sound_speed);
    let k = RIEMER.density * c * c;
    let equation = |x: f64| {
        let wall = PLANE * h / (a * a) - 7990.0 * h * (x * c / a).powi(2);
        k / a * x * bessel_j0(x) + wall * bessel_j1(x)
    };
    root(equation, low, high) * c / (2.0 * PI * a)
}

#[test]
fn breathing_modes_of_the_filled_tube() {
    let exact = [breathing(2.0, 3.0), breathing(5.0, 6.0), breathing(8.0, 9.0)];
    for (f, published) in exact.iter().zip([5745.9, 12_576.0, 19_577.0]) {
        assert!((f / published - 1.0).abs() < 1e-4, "{f} {published}");
    }
    // A pressure with its peak on the axis excites the modes; nothing depends on z.
    let mesh = straight(24, 2, RADIUS, 0.01);
    let shape = |r: f64| 1e6 * (-(r / 0.04).powi(2)).exp();
    let initial = mesh.centres().map(|[r, _]| shape(r)).collect();
    let vessel = elastic(mesh, THICKNESS, true);
    let dt = 0.5 * vessel.stable_step(RIEMER.sound_speed, 0.0);
    let mut solver = Solver::new(&vessel, INVISCID, linear_fluid(initial), dt);
    let signal: Vec<f64> = (0..(4e-3 / dt) as usize)
        .map(|_| {
            solver.step();
            solver.shell.r[1]
        })
        .collect();
    for (f, tolerance) in exact.into_iter().zip([1e-3, 3e-3, 8e-3]) {
        let found = frequency(&signal, dt, f, 600.0);
        assert!((found / f - 1.0).abs() < tolerance, "{found} {f}");
    }
}

#[test]
fn empty_ring_frequency() {
    // √(E/ρ_s/(1-ν²))/(2πa) for a long cylinder (plane strain): 8200 Hz.
    let exact = (PLANE / 7990.0).sqrt() / (2.0 * PI * RADIUS);
    assert!((exact - 8200.0).abs() < 1.0);
    let vessel = elastic(straight(2, 2, RADIUS, 0.01), THICKNESS, true);
    let nothing = FluidConstants { density: 1e-9, ..INVISCID };
    let initial = vec![1.0; vessel.mesh.volume.len()];
    let eos = TensileCutoff::new(nothing.density, 0.0, 0.0, initial);
    let dt = 0.2 * vessel.stable_step(0.0, 0.0);
    let mut solver = Solver::new(&vessel, nothing, eos, dt);
    let signal: Vec<f64> = (0..(5e-3 / dt) as usize)
        .map(|_| {
            solver.step();
            solver.shell.r[1]
        })
        .collect();
    let found = frequency(&signal, dt, exact, 500.0);
    assert!((found / exact - 1.0).abs() < 1e-3, "{found}");
}

/// Phase speed of the lowest mode `cos(πz/L)` of a tube with `L` = 40 radii.
fn long_wave_speed(axial_held: bool) -> f64 {
    let length = 40.0 * RADIUS;
    let mesh = straight(3, 80, RADIUS, length);
    let initial = mesh.centres().map(|[_, z]| 1e5 * (PI * z / length).cos()).collect();
    let vessel = elastic(mesh, THICKNESS, axial_held);
    let dt = 0.7 * vessel.stable_step(RIEMER.sound_speed, 0.0);
    let mut solver = Solver::new(&vessel, INVISCID, linear_fluid(initial), dt);
    let signal: Vec<f64> = (0..(0.06 / dt) as usize)
        .map(|_| {
            solver.step();
            solver.shell.r[3]
        })
        .collect();
    2.0 * length * frequency(&signal, dt, 570.0 / (2.0 * length), 15.0)
}

#[test]
fn long_waves_run_at_kortewegs_speed() {
    // Korteweg (1878): c/√(1 + 2K/(k a)) with k = Eh/((1-ν²)a²) for a wall held axially; with free axial motion the
    // wall is in plane stress, k = Eh/a² (Skalak 1956).
    let k = RIEMER.density * RIEMER.sound_speed.powi(2);
    let exact = |stiffness: f64| RIEMER.sound_speed / (1.0 + 2.0 * k / stiffness).sqrt();
    let held = exact(PLANE * THICKNESS / RADIUS);
    let free = exact(193e9 * THICKNESS / RADIUS);
    assert!((held - 576.0).abs() < 1.0 && (free - 553.0).abs() < 1.0);
    // Dispersion lowers the speed by a few tenths of (ka)² = 0.6 %.
    let (found_held, found_free) = (long_wave_speed(true), long_wave_speed(false));
    assert!((found_held / held - 1.0).abs() < 5e-3, "{found_held} {held}");
    assert!((found_free / free - 1.0).abs() < 8e-3, "{found_free} {free}");
}
