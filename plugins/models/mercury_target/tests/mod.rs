//! The production kernels against closed forms and exact properties of the equations.
#![allow(clippy::unwrap_used)]

mod acoustics;
mod balances;
mod bubbly_column;
mod cavitation;
mod gas;
mod inputs;
mod recorded;
mod survival;
mod tube;
mod wall;

use super::*;

/// Riemer's reference values.
const RIEMER: Mercury = Mercury { density: 13_500.0, sound_speed: 1456.0, tensile_cutoff: 1.5e5 };

/// Fluid constants without artificial damping.
const INVISCID: FluidConstants = FluidConstants {
    density: RIEMER.density,
    linear_viscosity: 0.0,
    quadratic_viscosity: 0.0,
    hourglass: 0.0,
};

/// Fluid of Riemer's mercury that never cavitates.
fn linear_fluid(initial: Vec<f64>) -> TensileCutoff {
    TensileCutoff::new(RIEMER.density, RIEMER.sound_speed, 1e15, initial)
}

/// A straight tube along `z` with flat ends.
fn straight(nr: usize, nz: usize, radius: f64, length: f64) -> Mesh {
    Mesh::new(nr, nz, |i, j| [radius * j as f64 / nr as f64, length * i as f64 / nz as f64])
}

/// A rigid tube, closed at both ends, without a steel wall.
fn rigid(mesh: Mesh) -> Vessel {
    let mut fluid = vec![[false; 2]; mesh.r.len()];
    for i in 0..=mesh.nz {
        fluid[mesh.node(i, 0)][0] = true;
        fluid[mesh.node(i, mesh.nr)][0] = true;
    }
    for j in 0..=mesh.nr {
        fluid[mesh.node(0, j)][1] = true;
        fluid[mesh.node(mesh.nz, j)][1] = true;
    }
    let held = Held { fluid, shell: Vec::new() };
    Vessel { mesh, shell: Shell::default(), held, joints: Joints::default() }
}

/// A tube with rigid ends and an elastic wall of 316L steel. The wall's ends keep their axial position and slope;
/// with `axial_held` all its nodes keep their axial position.
fn elastic(mesh: Mesh, thickness: f64, axial_held: bool) -> Vessel {
    let mut vessel = rigid(mesh);
    let mesh = &vessel.mesh;
    let nodes: Vec<usize> = (0..=mesh.nz).map(|i| mesh.node(i, mesh.nr)).collect();
    let steel = Steel { young_modulus: 193e9, poisson_ratio: 0.3, density: 7990.0 };
    let at = |n: usize| [mesh.r[n], mesh.z[n]];
    let element = |n: &[usize]| Element::new(at(n[0]), at(n[1]), thickness, steel, 0.0);
    vessel.shell = Shell::new(nodes.windows(2).map(element).collect());
    vessel.held.shell = vec![[false, axial_held, false]; nodes.len()];
    vessel.held.shell[0] = [false, true, true];
    vessel.held.shell[mesh.nz] = [false, true, true];
    for (s, &n) in nodes.iter().enumerate() {
        vessel.held.fluid[n][0] = false;
        vessel.joints.contacts.push((n, s, Contact::Slip));
    }
    vessel
}

/// Frequency near `guess` (within `width`, both Hz) at which a signal sampled every `dt`, s, has its largest windowed
/// Fourier amplitude.
fn frequency(signal: &[f64], dt: f64, guess: f64, width: f64) -> f64 {
    let n = signal.len() as f64;
    let mean = signal.iter().sum::<f64>() / n;
    let amplitude = |f: f64| {
        let (mut re, mut im) = (0.0, 0.0);
        for (k, x) in signal.iter().enumerate() {
            let window = 1.0 - (std::f64::consts::TAU * (k as f64 + 0.5) / n).cos();
            let phase = std::f64::consts::TAU * f * k as f64 * dt;
            re += window * (x - mean) * phase.cos();
            im += window * (x - mean) * phase.sin();
        }
        re.hypot(im)
    };
    let (mut centre, mut span) = (guess, width);
    for _ in 0..6 {
        let trial = |k: i32| centre + span * f64::from(k) / 10.0;
        centre =
            (-10..=10).map(trial).max_by(|a, b| amplitude(*a).total_cmp(&amplitude(*b))).unwrap();
        span /= 5.0;
    }
    centre
}

/// Root mean square difference of two runs' traces.
fn rms_difference(a: &Outcome, b: &Outcome) -> f64 {
    let pairs = a.strain.iter().flatten().zip(b.strain.iter().flatten());
    let squares: Vec<f64> = pairs.map(|(x, y)| (x - y).powi(2)).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// Root mean square of a run's traces.
fn rms(a: &Outcome) -> f64 {
    let n = a.strain.iter().flatten().count() as f64;
    (a.strain.iter().flatten().map(|x| x * x).sum::<f64>() / n).sqrt()
}

/// `J₀` by its integral, which the trapezoidal rule evaluates exactly to rounding (Abramowitz & Stegun 9.1.18).
fn bessel_j0(x: f64) -> f64 {
    let n = 64;
    (0..n)
        .map(|k| (x * (std::f64::consts::PI * (f64::from(k) + 0.5) / f64::from(n)).sin()).cos())
        .sum::<f64>()
        / f64::from(n)
}

/// `J₁` by its integral (Abramowitz & Stegun 9.1.21).
fn bessel_j1(x: f64) -> f64 {
    let n = 64;
    (0..n)
        .map(|k| {
            let t = std::f64::consts::PI * (f64::from(k) + 0.5) / f64::from(n);
            (t - x * t.sin()).cos()
        })
        .sum::<f64>()
        / f64::from(n)
}

/// A root of `f` between `low` and `high`.
fn root(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let sign = f(low).signum();
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if f(middle).signum() == sign {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}
