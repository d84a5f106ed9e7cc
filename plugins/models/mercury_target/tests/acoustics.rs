//! Mesh and fluid: exact geometry, patch test, rigid acoustics.

use std::f64::consts::PI;

use super::*;

/// A mesh like that of the vessel but skewed everywhere.
fn skewed() -> Mesh {
    Mesh::new(6, 9, |i, j| {
        let (x, y) = (i as f64 / 9.0, j as f64 / 6.0);
        [0.1 * y * (1.0 + 0.2 * x * (1.0 - y)), 0.04 * y * y * (1.0 - x) + 0.3 * x + 0.01 * x * y]
    })
}

#[test]
fn volumes_and_node_volumes_fill_the_body() {
    // The volume of a spherical cap, π h²(3R - h)/3, is missing from the cylinder; the meridian polygon of the cap
    // converges with second order.
    let geometry = Geometry::default();
    let depth = geometry.nose(geometry.radius);
    let cap = PI * depth * depth * (3.0 * geometry.cap_radius - depth) / 3.0;
    let exact = PI * geometry.radius.powi(2) * (geometry.length - depth) + cap;
    let error = |cells| {
        let mut settings = Settings::default();
        settings.numerics.mesh = Cells::Explicit(cells);
        let target = Target::new(&settings).unwrap();
        let mesh = &target.vessel().mesh;
        let volume: f64 = mesh.volume.iter().sum();
        let carried: f64 = mesh.node_volume.iter().sum();
        assert!((volume / carried - 1.0).abs() < 1e-12);
        (volume / exact - 1.0).abs()
    };
    let (coarse, fine) = (error([10, 45]), error([20, 90]));
    assert!(coarse < 1e-3 && (coarse / fine - 4.0).abs() < 0.2, "{coarse} {fine}");
}

#[test]
fn volume_derivatives_are_derivatives() {
    let mesh = skewed();
    let step = 1e-6;
    for (radial, b) in [(true, &mesh.b_r), (false, &mesh.b_z)] {
        let (cell, node) = (4 * mesh.nz + 3, mesh.node(4, 5));
        let moved = |sign: f64| {
            Mesh::new(mesh.nr, mesh.nz, |i, j| {
                let n = mesh.node(i, j);
                let shift = if n == node { sign * step } else { 0.0 };
                if radial { [mesh.r[n] + shift, mesh.z[n]] } else { [mesh.r[n], mesh.z[n] + shift] }
            })
            .volume[cell]
        };
        let numeric = (moved(1.0) - moved(-1.0)) / (2.0 * step);
        assert!((numeric - b[2][cell]).abs() < 1e-8 * mesh.b_r[2][cell].abs());
    }
}

#[test]
fn a_uniform_pressure_pushes_on_the_wall_only_and_with_no_net_force() {
    let vessel = rigid(skewed());
    let mesh = &vessel.mesh;
    let uniform = linear_fluid(vec![1e6; mesh.volume.len()]);
    let solver = Solver::new(&vessel, INVISCID, uniform, 1e-7);
    let force = solver.force();
    let scale = 1e6 * 0.1 * 0.1;
    let mut total = 0.0;
    for j in 0..=mesh.nr {
        for i in 0..=mesh.nz {
            let n = mesh.node(i, j);
            total += force.fluid_z[n];
            if i > 0 && i < mesh.nz && j < mesh.nr {
                assert!(force.fluid_z[n].abs() < 1e-12 * scale);
                // Radially the pressure of a ring balances at the nodes; on the axis the motion is held.
                assert!(j == 0 || force.fluid_r[n].abs() < 1e-12 * scale);
            }
        }
    }
    assert!(total.abs() < 1e-12 * scale);
}

#[test]
fn a_linear_pressure_accelerates_every_node_alike() {
    // Masses from ∫ N 2πr dA make -grad p / ρ exact for a linear pressure on straight cells, on the axis also
    // (derivation in the mesh module).
    let mesh = straight(5, 8, 0.1, 0.2);
    let slope = 2e6;
    let pressure = mesh.centres().map(|[_, z]| slope * z).collect();
    let vessel = rigid(mesh);
    let mesh = &vessel.mesh;
    let solver = Solver::new(&vessel, INVISCID, linear_fluid(pressure), 1e-7);
    for j in 0..=mesh.nr {
        for i in 1..mesh.nz {
            let n = mesh.node(i, j);
            let acceleration = solver.force().fluid_z[n] / solver.mass().fluid_z[n];
            assert!((acceleration * INVISCID.density / -slope - 1.0).abs() < 1e-12);
        }
    }
}

/// Largest error of the pressure after one period of the mode `p = J₀(j₁₁ r/a) cos(πz/L) cos ωt`,
/// `ω = c √((j₁₁/a)² + (π/L)²)` of a rigid closed cylinder (Kinsler et al., Fundamentals of Acoustics, ch. 9), relative
/// to its amplitude.
fn mode_error(nr: usize) -> f64 {
    const J11: f64 = 3.831_705_970_207_512;
    let (a, l, c) = (0.1, 0.15, RIEMER.sound_speed);
    let mode = move |r: f64, z: f64| bessel_j0(J11 * r / a) * (PI * z / l).cos();
    let mesh = straight(nr, nr * 3 / 2, a, l);
    let initial: Vec<f64> = mesh.centres().map(|[r, z]| 1e6 * mode(r, z)).collect();
    let vessel = rigid(mesh);
    let period = 2.0 * PI / (c * (J11 / a).hypot(PI / l));
    let steps = 6 * nr;
    let fluid = linear_fluid(initial.clone());
    let mut solver = Solver::new(&vessel, INVISCID, fluid, period / steps as f64);
    for _ in 0..steps {
        solver.step();
    }
    let difference = solver.fluid.pressure.iter().zip(&initial).map(|(p, q)| (p - q).powi(2));
    let size: f64 = initial.iter().map(|q| q * q).sum();
    (difference.sum::<f64>() / size).sqrt()
}

#[test]
fn rigid_acoustics_converge_with_second_order() {
    let errors = [8, 16, 32].map(mode_error);
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!(order > 1.8, "errors {errors:?}");
    }
    assert!(errors[2] < 5e-3, "errors {errors:?}");
}

#[test]
fn plane_waves_leave_through_the_open_end() {
    // A half space has no reflection: after the pulse has left, only the error of the discretisation remains.
    let mesh = straight(1, 200, 0.1, 1.0);
    let initial: Vec<f64> =
        mesh.centres().map(|[_, z]| 1e6 * (-((z - 0.5) / 0.08).powi(2)).exp()).collect();
    let mut vessel = rigid(mesh);
    let last = vessel.mesh.nz;
    for j in 0..=1 {
        let n = vessel.mesh.node(last, j);
        vessel.held.fluid[n][1] = false;
        vessel.joints.open_end.push(n);
    }
    let dt = 0.7 * vessel.stable_step(RIEMER.sound_speed, 0.0);
    let mut solver = Solver::new(&vessel, INVISCID, linear_fluid(initial), dt);
    while solver.steps as f64 * dt < 2.0 / RIEMER.sound_speed {
        solver.step();
    }
    let energy = solver.energy();
    assert!(energy.radiated / energy.start > 0.9999, "{energy:?}");
    assert!(energy.imbalance().abs() < 1e-6, "{energy:?}");
}
