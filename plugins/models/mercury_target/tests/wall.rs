//! The shell alone, in equilibrium with given loads.

use std::f64::consts::PI;

use nalgebra::{Complex, DMatrix, DVector};

use super::*;

const STEEL: Steel = Steel { young_modulus: 193e9, poisson_ratio: 0.3, density: 7990.0 };

/// Displacements (r, z, rotation) of each node in equilibrium with a force on each motion.
fn equilibrium(shell: &Shell, held: &[[bool; 3]], load: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let n = 3 * shell.nodes();
    let force = |u: &[f64]| {
        let mut moved = shell.clone();
        for (node, u) in u.chunks(3).enumerate() {
            (moved.r[node], moved.z[node], moved.turn[node]) = (u[0], u[1], u[2]);
        }
        let mut force = Field::zeros(0, shell.nodes());
        moved.forces(&mut force);
        (0..n).map(|k| force.parts()[2 + k % 3][k / 3]).collect::<Vec<f64>>()
    };
    let rest = force(&vec![0.0; n]);
    let mut stiffness = DMatrix::zeros(n, n);
    for column in 0..n {
        let mut unit = vec![0.0; n];
        unit[column] = 1.0;
        for (row, f) in force(&unit).into_iter().enumerate() {
            stiffness[(row, column)] = rest[row] - f;
        }
    }
    let mut right = DVector::from_fn(n, |k, _| load[k / 3][k % 3] + rest[k]);
    for k in 0..n {
        if held[k / 3][k % 3] {
            stiffness.row_mut(k).fill(0.0);
            stiffness.column_mut(k).fill(0.0);
            stiffness[(k, k)] = 1.0;
            right[k] = 0.0;
        }
    }
    assert!((&stiffness - stiffness.transpose()).amax() < 1e-9 * stiffness.amax());
    let solution = stiffness.lu().solve(&right).unwrap();
    solution.as_slice().chunks(3).map(|u| [u[0], u[1], u[2]]).collect()
}

fn chain(nodes: &[[f64; 2]], thickness: f64, eigenstrain: f64) -> Shell {
    let element = |n: &[[f64; 2]]| Element::new(n[0], n[1], thickness, STEEL, eigenstrain);
    Shell::new(nodes.windows(2).map(element).collect())
}

#[test]
fn clamped_circular_plate_under_uniform_pressure() {
    // w(0) = p a⁴/(64 D) + p a²/(4 · 5/6 G h): Timoshenko & Woinowsky-Krieger, Theory of Plates and Shells, § 17 and
    // § 20 (with the shear factor of Reissner).
    let (a, h, p) = (0.1, 8e-3, 1e5);
    let bending = STEEL.young_modulus * h * h * h / (12.0 * (1.0 - 0.09));
    let shear = 5.0 / 6.0 * STEEL.young_modulus / 2.6 * h;
    let exact = p * a * a * a * a / (64.0 * bending) + p * a * a / (4.0 * shear);
    let n = 60;
    let nodes: Vec<[f64; 2]> = (0..=n).map(|k| [a * f64::from(k) / f64::from(n), 0.0]).collect();
    let shell = chain(&nodes, h, 0.0);
    let mut held = vec![[false; 3]; nodes.len()];
    held[0] = [true, false, true];
    held[nodes.len() - 1] = [true; 3];
    let mut load = vec![[0.0; 3]; nodes.len()];
    for (k, ends) in nodes.windows(2).enumerate() {
        let (near, far) = (ends[0][0], ends[1][0]);
        load[k][1] -= p * 2.0 * PI * (far - near) * (2.0 * near + far) / 6.0;
        load[k + 1][1] -= p * 2.0 * PI * (far - near) * (2.0 * far + near) / 6.0;
    }
    let found = -equilibrium(&shell, &held, &load)[0][1];
    assert!((found / exact - 1.0).abs() < 2e-3, "{found} {exact}");
}

#[test]
fn clamped_end_of_a_cylinder_under_pressure() {
    // Timoshenko & Woinowsky-Krieger § 114: a beam on the elastic foundation k = Eh/a² (axially free), here with the
    // shear stiffness S of the Mindlin theory: D β'' = S (β + w'), S (β' + w'') = k w - p, so that D m⁴ - (Dk/S) m² +
    // k = 0 for w ~ e^{mx}.
    let (a, h, p, length) = (0.1, 3e-3, 1e6, 0.2);
    let (k, d): (f64, f64) = (193e9 * h / (a * a), 193e9 * h * h * h / (12.0 * 0.91));
    let s = 5.0 / 6.0 * 193e9 / 2.6 * h;
    let square = Complex::new(k / (2.0 * s), (k / d - (k / (2.0 * s)).powi(2)).sqrt());
    let m = -square.sqrt();
    let turn = m * s / (m * m * d - s);
    let amplitude = Complex::new(-1.0, -turn.re / turn.im) * (p / k);
    let exact = |x: f64| p / k + (amplitude * (m * x).exp()).re;
    let n = 100;
    let nodes: Vec<[f64; 2]> = (0..=n).map(|k| [a, length * f64::from(k) / f64::from(n)]).collect();
    let shell = chain(&nodes, h, 0.0);
    let mut held = vec![[false; 3]; nodes.len()];
    held[0] = [true; 3];
    held[nodes.len() - 1][2] = true;
    let mut load = vec![[0.0; 3]; nodes.len()];
    for (k, ends) in nodes.windows(2).enumerate() {
        let ring = p * PI * a * (ends[1][1] - ends[0][1]);
        load[k][0] += ring;
        load[k + 1][0] += ring;
    }
    let found = equilibrium(&shell, &held, &load);
    let far = exact(0.1);
    for (u, node) in found.iter().zip(&nodes).take(60) {
        assert!((u[0] - exact(node[1])).abs() < 3e-3 * far, "{} {}", node[1], u[0] / far);
    }
}

#[test]
fn a_free_wall_expands_by_its_eigenstrain_without_stress() {
    let nodes: Vec<[f64; 2]> = (0..=20)
        .map(|k| {
            let angle = 0.05 * f64::from(k);
            [0.16 * angle.sin(), 0.16 * (1.0 - angle.cos())]
        })
        .collect();
    let shell = chain(&nodes, 3e-3, 20e-6);
    let mut held = vec![[false; 3]; nodes.len()];
    held[0] = [true; 3];
    let found = equilibrium(&shell, &held, &vec![[0.0; 3]; nodes.len()]);
    for (u, node) in found.iter().zip(&nodes) {
        assert!((u[0] - 20e-6 * node[0]).abs() < 1e-12);
        assert!((u[1] - 20e-6 * node[1]).abs() < 1e-12);
    }
}

#[test]
fn gauges_read_a_linear_field_where_they_sit() {
    // u_z = k z²/2 on the cylinder: axial strain k z; u_r = 0: no hoop strain.
    let target = Target::new(&Settings::default()).unwrap();
    let vessel = target.vessel();
    let mut shell = vessel.shell.clone();
    let first = vessel.mesh.nr;
    for i in 0..=vessel.mesh.nz {
        let z = vessel.mesh.z[vessel.mesh.node(i, first)];
        shell.z[first + i] = 1e-3 * z * z / 2.0;
    }
    let read = |gauge: usize| target.sensors()[gauge].read(&shell);
    for (gauge, z) in [(3, 0.1), (8, 0.15), (9, 0.2)] {
        assert!((read(gauge) / (1e-3 * z) - 1.0).abs() < 1e-9, "{}", read(gauge));
    }
    for gauge in [1, 2, 4, 5, 6, 7] {
        assert!(read(gauge).abs() < 1e-12);
    }
}
