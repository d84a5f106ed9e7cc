//! Small waves in a closed column of bubbly mercury against the theory of bubbly liquids.

use std::f64::consts::{PI, TAU};

use nalgebra::{Complex, Matrix2, Vector2};

use super::*;

const LENGTH: f64 = 0.2;
const CELLS: usize = 100;

/// Amplitude of the waves, Pa: small compared with any ambient pressure.
const SMALL: f64 = 1e-3;

/// Pressure at the closed end of a column that starts at rest in the shape of its longest wave, and the time between
/// the values.
fn standing_wave(bubbles: Bubbles, share: f64, cfl: f64, end: f64) -> (Vec<f64>, f64) {
    let vessel = rigid(straight(1, CELLS, 0.01, LENGTH));
    let shape = |[_, z]: [f64; 2]| SMALL * (PI * z / LENGTH).cos();
    let initial: Vec<f64> = vessel.mesh.centres().map(shape).collect();
    let cells = initial.len();
    let eos = Bubbly::new(linear_fluid(initial), bubbles, vec![share; cells]);
    let dt = cfl * vessel.stable_step(RIEMER.sound_speed, 0.0);
    let mut solver = Solver::new(&vessel, INVISCID, eos, dt);
    let mut pressures = Vec::new();
    while (solver.steps as f64) * dt < end {
        solver.step();
        pressures.push(solver.fluid.pressure[0]);
    }
    (pressures, dt)
}

fn bubbles(relaxation: f64) -> Bubbles {
    let Gas { ambient_pressure, polytropic_index, .. } = Gas::default();
    Bubbles { ambient_pressure, polytropic_index, relaxation }
}

/// Compliance of the gas, `a₀/κP`.
fn compliance(share: f64) -> f64 {
    let Gas { ambient_pressure, polytropic_index, .. } = Gas::default();
    share / (polytropic_index * ambient_pressure)
}

#[test]
fn gas_in_equilibrium_carries_waves_at_woods_speed() {
    // Wood, A Textbook of Sound (1930): 1/ρ_m c_m² = (1 - a)/ρc² + a/κp.
    let Mercury { density, sound_speed, .. } = RIEMER;
    for share in [1e-6, 1e-5, 1e-4, 3e-4, 1e-3] {
        let elastic = (1.0 - share) / (density * sound_speed.powi(2)) + compliance(share);
        let wood = 1.0 / ((1.0 - share) * density * elastic).sqrt();
        let period = 2.0 * LENGTH / wood;
        let (pressure, dt) = standing_wave(bubbles(0.0), share, 0.5, 12.0 * period);
        let found = 2.0 * LENGTH * frequency(&pressure, dt, 1.0 / period, 0.3 / period);
        assert!((found / wood - 1.0).abs() < 2e-3, "{share}: {found} {wood}");
    }
}

/// The decaying oscillation `e^{st}` in a signal, by Prony's method on values `stride` apart:
/// `x₂ = 2 Re(z) x₁ - |z|² x₀` with `z = e^{s stride dt}`.
fn oscillation(signal: &[f64], stride: usize, dt: f64) -> Complex<f64> {
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for triple in signal.windows(2 * stride + 1) {
        let row = Vector2::new(triple[stride], triple[0]);
        normal += row * row.transpose();
        right += row * triple[2 * stride];
    }
    let found = normal.lu().solve(&right).unwrap();
    let (middle, product) = (0.5 * found[0], -found[1]);
    let z = Complex::new(middle, (product - middle * middle).sqrt());
    z.ln() / (stride as f64 * dt)
}

/// A root of a function near `near`, by the secant method.
fn complex_root(f: impl Fn(Complex<f64>) -> Complex<f64>, near: Complex<f64>) -> Complex<f64> {
    let (mut a, mut b) = (near, near * 1.001);
    for _ in 0..50 {
        let (fa, fb) = (f(a), f(b));
        if fa == fb {
            break;
        }
        (a, b) = (b, b - fb * (b - a) / (fb - fa));
    }
    b
}

#[test]
fn bubbles_disperse_and_damp_waves_as_their_linear_relaxation_does() {
    // Motion e^{st} of the wave number k: s² ρ (1/K + a₀/κP/(1 + sτ)) + k² = 0, the linearised law. The step is
    // implicit in the gas and of first order, which requires short steps.
    let Mercury { density, sound_speed, .. } = RIEMER;
    let (wave_number, modulus) = (PI / LENGTH, density * sound_speed.powi(2));
    for (share, relaxation) in [(1e-4, 2e-6), (1e-4, 1e-5), (3e-4, 5e-6), (1e-5, 5e-5)] {
        let law = |s: Complex<f64>| {
            let soft = Complex::from(compliance(share)) / (s * relaxation + 1.0);
            s * s * density * (soft + 1.0 / modulus) + wave_number.powi(2)
        };
        let wood = 1.0 / (density * (1.0 / modulus + compliance(share))).sqrt();
        let exact = complex_root(law, Complex::new(0.0, wave_number * wood));
        let period = TAU / exact.im;
        let (pressure, dt) = standing_wave(bubbles(relaxation), share, 0.1, 3.0 * period);
        // The third root is real and decays within few relaxation times.
        let tail = &pressure[(4.0 * relaxation / dt) as usize..];
        let found = oscillation(tail, (0.1 * period / dt) as usize, dt);
        assert!((found - exact).norm() < 0.01 * exact.norm(), "{found} {exact}");
        assert!((found.re / exact.re - 1.0).abs() < 0.03, "{found} {exact}");
    }
}

#[test]
fn slow_waves_are_those_of_commander_and_prosperetti() {
    // J. Acoust. Soc. Am. 85 (1989) 732: k² = ω²/c² + 4πω²nR/(ω₀² - ω² + 2ibω), ω = is, n bubbles per volume, ω₀
    // Minnaert's frequency. Far below ω₀ only 2b/ω₀² of the bubbles' own motion remains: it is the relaxation time
    // 1/ω₀ for b = ω₀/2, up to (ω/ω₀)².
    let Mercury { density, sound_speed, .. } = RIEMER;
    let wave_number = PI / LENGTH;
    for (share, radius) in [(1e-4, 2e-5), (1e-4, 1e-4), (4e-4, 2e-4)] {
        let gas = Gas { bubble_radius: radius, ..Gas::default() };
        let own = (3.0 * gas.polytropic_index * gas.ambient_pressure / density).sqrt() / radius;
        let number = share / (4.0 / 3.0 * PI * radius.powi(3));
        let law = |s: Complex<f64>| {
            let bubble = s * s + s * own + own * own;
            let mixture = Complex::from(4.0 * PI * number * radius) / bubble;
            s * s * (mixture + 1.0 / sound_speed.powi(2)) + wave_number.powi(2)
        };
        let wood = 1.0 / (1.0 / sound_speed.powi(2) + density * compliance(share)).sqrt();
        let exact = complex_root(law, Complex::new(0.0, wave_number * wood));
        let (period, ratio) = (TAU / exact.im, exact.im / own);
        let (pressure, dt) = standing_wave(gas.bubbles(density), share, 0.1, 3.0 * period);
        let tail = &pressure[(4.0 / own / dt) as usize..];
        let found = oscillation(tail, (0.1 * period / dt) as usize, dt);
        assert!(ratio < 0.4, "{ratio}");
        let error = (found - exact).norm() / exact.norm();
        assert!(error < 0.002 + ratio.powi(2), "{error} {ratio}: {found} {exact}");
    }
}

#[test]
fn bubbles_relax_within_minnaerts_period() {
    // Minnaert (1933), f₀ = √(3κp/ρ)/2πR in mercury at 3 bar: 154 kHz for 10 µm, 31 kHz for 50 µm, 3.1 kHz for 500
    // µm.
    for (radius, frequency, digit) in [(1e-5, 154e3, 1e3), (5e-5, 31e3, 1e3), (5e-4, 3.1e3, 1e2)] {
        let gas = Gas { bubble_radius: radius, ..Gas::default() };
        let found = 1.0 / (TAU * gas.bubbles(RIEMER.density).relaxation);
        assert!((found - frequency).abs() < digit, "{found}");
    }
}

#[test]
fn damped_waves_fall_off_at_half_the_rate() {
    // ü + βu̇ + ω²u = 0: e^{-βt/2} at √(ω² - β²/4).
    let vessel = rigid(straight(1, CELLS, 0.01, LENGTH));
    let shape = |[_, z]: [f64; 2]| SMALL * (PI * z / LENGTH).cos();
    let initial = vessel.mesh.centres().map(shape).collect();
    let dt = 0.5 * vessel.stable_step(RIEMER.sound_speed, 0.0);
    let mut solver = Solver::new(&vessel, INVISCID, linear_fluid(initial), dt);
    solver.damping = 2000.0;
    let mut pressure = Vec::new();
    for _ in 0..2000 {
        solver.step();
        pressure.push(solver.fluid.pressure[0]);
    }
    let free = PI * RIEMER.sound_speed / LENGTH;
    let exact = Complex::new(-1000.0, (free.powi(2) - 1e6).sqrt());
    let found = oscillation(&pressure, 40, dt);
    assert!((found.re / exact.re - 1.0).abs() < 1e-4, "{found} {exact}");
    assert!((found.im / exact.im - 1.0).abs() < 1e-3, "{found} {exact}");
    let energy = solver.energy();
    assert!(energy.damped > 0.5 * energy.start && energy.imbalance().abs() < 1e-11, "{energy:?}");
}
