//! A plate on a half space of fluid that cannot bear tension: Taylor's plate, and cavitation with reclosure after
//! Bleich and Sandler.

use super::*;

/// A half space of fluid below a plate; `z` is the depth.
struct Plate {
    density: f64,
    sound_speed: f64,
    cutoff: f64,
    /// Mass per area, kg/m².
    mass: f64,
    /// Depth and number of cells.
    depth: f64,
    cells: usize,
}

impl Plate {
    fn vessel(&self) -> Vessel {
        let radius: f64 = 0.1;
        let mut vessel = rigid(straight(1, self.cells, radius, self.depth));
        let nodes = vec![vessel.mesh.node(0, 0), vessel.mesh.node(0, 1)];
        for &n in &nodes {
            vessel.held.fluid[n][1] = false;
        }
        let mass = self.mass * std::f64::consts::PI * radius * radius;
        vessel.joints.plate = Some((nodes, mass));
        vessel
    }

    /// Runs until `end`. The fluid starts with pressure `p(depth)`; if that is a wave towards the plate, it moves at
    /// `p/ρc`. `watch` gets time, plate velocity (away from the fluid) and the solver.
    fn run(
        &self,
        viscosity: (f64, f64),
        pressure: impl Fn(f64) -> f64,
        wave: bool,
        end: f64,
        mut watch: impl FnMut(f64, f64, &Solver<'_, TensileCutoff>),
    ) {
        let vessel = self.vessel();
        let mesh = &vessel.mesh;
        let initial = mesh.centres().map(|[_, z]| pressure(z)).collect();
        let eos = TensileCutoff::new(self.density, self.sound_speed, self.cutoff, initial);
        let constants = FluidConstants {
            density: self.density,
            linear_viscosity: viscosity.0,
            quadratic_viscosity: viscosity.1,
            hourglass: 0.0,
        };
        let dt = 0.7 * vessel.stable_step(self.sound_speed, viscosity.0);
        let mut solver = Solver::new(&vessel, constants, eos, dt);
        if wave {
            let impedance = self.density * self.sound_speed;
            for n in 0..mesh.r.len() {
                solver.velocity.fluid_z[n] = -pressure(mesh.z[n]) / impedance;
            }
            // The half cell that the plate carries contributes its momentum.
            let half = 0.5 * self.density * self.depth / self.cells as f64;
            let share = half / (half + self.mass);
            for n in [mesh.node(0, 0), mesh.node(0, 1)] {
                solver.velocity.fluid_z[n] *= share;
            }
        }
        while (solver.steps as f64) * dt < end {
            solver.step();
            // Velocities belong to the time half a step before the current one.
            let time = (solver.steps as f64 - 0.5) * dt;
            watch(time, -solver.velocity.fluid_z[0], &solver);
        }
    }
}

#[test]
fn a_plate_takes_up_an_exponential_wave_and_leaves_the_fluid() {
    // Taylor (1941): v = (2P/ρc) b/(b-1) (e^{-t/τ} - e^{-bt/τ}), b = ρcτ/m, and the pressure at the plate vanishes at
    // τ ln b/(b-1).
    let plate = Plate {
        density: 13_500.0,
        sound_speed: 1456.0,
        cutoff: 0.0,
        mass: 200.0,
        depth: 0.4,
        cells: 1600,
    };
    let (peak, tau) = (20e6, 3e-5);
    let impedance = plate.density * plate.sound_speed;
    let b = impedance * tau / plate.mass;
    let leaves = tau * b.ln() / (b - 1.0);
    let velocity =
        |t: f64| 2.0 * peak / impedance * b / (b - 1.0) * ((-t / tau).exp() - (-b * t / tau).exp());
    let (mut worst, mut first) = (0.0_f64, f64::INFINITY);
    let wave = |z: f64| peak * (-z / plate.sound_speed / tau).exp();
    plate.run((0.0, 0.0), wave, true, 1.3 * leaves, |t, v, solver| {
        if t < leaves {
            worst = worst.max((v - velocity(t)).abs());
        }
        if solver.fluid.speed.contains(&0.0) {
            first = first.min(t);
        }
    });
    assert!(worst < 0.01 * velocity(leaves), "{worst} {}", velocity(leaves));
    assert!((first / leaves - 1.0).abs() < 0.02, "{first} {leaves}");
}

#[test]
fn a_plate_is_pushed_off_by_a_uniform_pressure() {
    // Half space at p₀ against a plate: v = (p₀/ρc)(1 - e^{-ρct/m}) (characteristics: p + ρcv = p₀ at the plate). 25
    // MPa gives 1.27 m/s.
    let plate = Plate {
        density: 13_500.0,
        sound_speed: 1456.0,
        cutoff: 0.0,
        mass: 200.0,
        depth: 0.4,
        cells: 1600,
    };
    let impedance = plate.density * plate.sound_speed;
    let limit = 25e6 / impedance;
    assert!((limit - 1.27).abs() < 0.005);
    let mut worst = 0.0_f64;
    plate.run(
        (0.0, 0.0),
        |_| 25e6,
        false,
        6e-5,
        |t, v, _| {
            worst = worst.max((v - limit * (1.0 - (-impedance * t / plate.mass).exp())).abs());
        },
    );
    assert!(worst < 0.01 * limit, "{worst}");
}

/// The exact solution of Bleich and Sandler's problem (Int. J. Solids Structures 6, 1970, 617) without gravity. A
/// plate of mass `m` per area floats on a fluid with cutoff `p_c` (gauge pressure, so that `p_c` is the atmosphere)
/// and is hit by `P e^{-t/τ}`. The fluid then cavitates below a thin layer that stays with the plate; the layer
/// collects the fluid that it meets, and the atmosphere decelerates it.
///
/// With depth `d`, `s = t - d/c` and `σ = t + d/c`, the liquid fluid has `p = F(σ) + G(s)` and upward velocity
/// `w = (F - G)/ρc`; at the plate `G = F - ρcw`, `m w' = 2F - ρcw`.
/// - Inception: `F(σ) + G(s) = -p_c`, a curve in (s, σ) that is faster than sound where `dσ/ds < 0`, so that Taylor's
///   solution is valid up to it. Its lower branch extends to any depth, its upper branch ends where `G' = 0`.
/// - In the cavitated fluid `p = -p_c`, so that `w` keeps its value `w₀(d)` of the inception at `t₀(d)`, and the
///   strain beyond the cutoff is `δ = -(t - t₀) w₀'(d)`.
/// - Closure at `D(t)`: momentum `[p] = ρV[u]` and volume `V([p]/K + δ) = [u]`, `u = -w`, with the characteristic
///   that comes from the plate, `[p] + ρc[u] = R = 2G + p_c + ρc w₀`, give `V = Rc/(ρc²δ + R)`, `[p] = RV/(V + c)`;
///   the front emits `F = [p] - p_c - G` upwards.
struct Characteristics {
    /// Time step of the tables.
    dt: f64,
    /// Plate velocity at multiples of `dt`.
    velocity: Vec<f64>,
    /// Depth of the closure front at multiples of `dt`; zero before it exists.
    closure: Vec<f64>,
    /// Time and depth of the opening front.
    opening: Vec<(f64, f64)>,
}

/// Peak (Pa) and decay time (s) of the wave.
const WAVE: (f64, f64) = (0.7e6, 1e-3);

fn floating() -> Plate {
    Plate {
        density: 1000.0,
        sound_speed: 1500.0,
        cutoff: 1e5,
        mass: 150.0,
        depth: 12.0,
        cells: 2400,
    }
}

impl Characteristics {
    fn new(plate: &Plate, end: f64) -> Self {
        let (c, pc, (peak, tau)) = (plate.sound_speed, plate.cutoff, WAVE);
        let z = plate.density * c;
        let b = z * tau / plate.mass;
        let incident = |s: f64| peak * (-s / tau).exp();
        let taylor =
            |t: f64| 2.0 * peak / z * b / (b - 1.0) * ((-t / tau).exp() - (-b * t / tau).exp());
        let reflected = |s: f64| incident(s) - z * taylor(s);
        // G' = F' - ρc v' changes sign at s₂; G reaches -p_c at s₀, at infinite depth.
        let slope = |s: f64| {
            let v = 2.0 * peak / z * b / (b - 1.0)
                * (-(-s / tau).exp() / tau + b / tau * (-b * s / tau).exp());
            -incident(s) / tau - z * v
        };
        let s2 = root(slope, 1e-9, 2.0 * tau);
        let s0 = root(|s| reflected(s) + pc, 1e-9, s2);
        let sigma = |s: f64| -tau * ((-pc - reflected(s)) / peak).ln();
        let depth = |s: f64| 0.5 * c * (sigma(s) - s);
        // Inception at a depth: time, and velocity from then on.
        let inception = |d: f64| {
            let s = root(|s| depth(s) - d, s0 * (1.0 + 1e-12), s2);
            (0.5 * (s + sigma(s)), (-pc - 2.0 * reflected(s)) / z)
        };
        let (d2, t2) = (depth(s2), 0.5 * (s2 + sigma(s2)));

        let dt = d2 / c / 40.0;
        let steps = (end / dt) as usize;
        let (mut velocity, mut closure) = (vec![0.0], vec![0.0]);
        let (mut sent, mut depth_now) = (vec![(sigma(s2), incident(sigma(s2)))], d2);
        for k in 0..steps {
            let t = (k as f64 + 0.5) * dt;
            let incoming = |t: f64| {
                let next = sent.partition_point(|&(sigma, _)| sigma <= t);
                if next == 0 {
                    return incident(t);
                }
                let ((t0, f0), (t1, f1)) = (sent[next - 1], sent[next]);
                f0 + (f1 - f0) * (t - t0) / (t1 - t0)
            };
            let (decay, v) = ((-z * dt / plate.mass).exp(), velocity[k]);
            let forced = 2.0 * incoming(t) / z;
            velocity.push(forced + (v - forced) * decay);
            let now = (k + 1) as f64 * dt;
            if now <= t2 {
                closure.push(0.0);
                continue;
            }
            let s = now - depth_now / c;
            let g = if s <= sigma(s2) {
                reflected(s)
            } else {
                let (cell, part) = ((s / dt) as usize, (s / dt).fract());
                incoming(s) - z * (velocity[cell] * (1.0 - part) + velocity[cell + 1] * part)
            };
            let ((t0, w0), (_, w1)) = (inception(depth_now), inception(depth_now + 1e-4 * c * tau));
            let opening = (now - t0) * (w0 - w1) / (1e-4 * c * tau);
            let drive = (2.0 * g + pc + z * w0).max(0.0);
            let speed = if drive > 0.0 { drive * c / (z * c * opening + drive) } else { 0.0 };
            sent.push((now + depth_now / c, drive * speed / (speed + c) - pc - g));
            depth_now += speed * dt;
            closure.push(depth_now);
        }
        let depths = (0..=400).map(|k| d2 + (c * end - d2) * f64::from(k) / 400.0);
        let opening = depths.map(|d| (inception(d).0, d)).collect();
        Self { dt, velocity, closure, opening }
    }

    fn velocity(&self, t: f64) -> f64 {
        self.velocity[((t / self.dt) as usize).min(self.velocity.len() - 1)]
    }

    fn closure(&self, t: f64) -> f64 {
        self.closure[((t / self.dt) as usize).min(self.closure.len() - 1)]
    }

    fn opening(&self, t: f64) -> f64 {
        let next = self.opening.partition_point(|point| point.0 < t);
        let ((t0, d0), (t1, d1)) = (self.opening[next - 1], self.opening[next]);
        d0 + (d1 - d0) * (t - t0) / (t1 - t0)
    }
}

#[test]
fn cavitation_under_a_floating_plate_opens_and_closes_as_computed_by_characteristics() {
    let plate = floating();
    let end = 7e-3;
    let exact = Characteristics::new(&plate, end);
    let wave = |z: f64| WAVE.0 * (-z / plate.sound_speed / WAVE.1).exp();
    let cell = plate.depth / plate.cells as f64;
    // The velocity of Taylor's plate has its maximum (2P/ρc) b^{1/(1-b)}, b = 10, while the plate is still in
    // contact.
    let peak = exact.velocity.iter().copied().fold(0.0, f64::max);
    let taylor = 2.0 * WAVE.0 / (plate.density * plate.sound_speed) * 10.0_f64.powf(-1.0 / 9.0);
    assert!((peak / taylor - 1.0).abs() < 1e-3, "{peak} {taylor}");
    assert!(exact.velocity(end) < 0.0, "the atmosphere turns the plate back");
    // Without linear viscosity the layer at the plate oscillates after the jump at the start and cavitates again.
    // With it, the weak wave that opens the depths is smoothed and thus delayed in proportion.
    let any = f64::INFINITY;
    for (linear, limits) in
        [(0.0, [any, any, 10.0]), (0.06, [0.02, any, 40.0]), (0.25, [0.02, 8.0, 90.0])]
    {
        let (mut velocity, mut closure, mut opening) = (0.0_f64, 0.0_f64, 0.0_f64);
        plate.run((linear, 1.2), wave, true, end, |t, v, solver| {
            velocity = velocity.max((v - exact.velocity(t)).abs());
            let cavitated = |whole: &f64| *whole == 0.0;
            if t > 5e-4 {
                let top = solver.fluid.speed.iter().position(cavitated).unwrap() as f64;
                let bottom = solver.fluid.speed.iter().rposition(cavitated).unwrap() as f64;
                closure = closure.max((top - exact.closure(t) / cell).abs());
                opening = opening.max((bottom - exact.opening(t) / cell).abs());
            }
        });
        let errors = [velocity / peak, closure, opening];
        assert!(errors.iter().zip(limits).all(|(e, l)| *e < l), "{linear} {errors:?}");
    }
}

#[test]
fn a_cavitated_column_closes_against_a_wall() {
    // Water hammer in a fluid with excess strain δ that arrives at speed v: over the front [p] = ρVv and V([p]/K + δ)
    // = v, so that V solves v(1 - V²/c²) = Vδ.
    let (density, c, cutoff) = (13_500.0, 1456.0, 1.5e5);
    let k: f64 = density * c * c;
    for (v, excess) in [(0.5, 1e-3_f64), (2.0, 1e-3), (2.0, 1e-2)] {
        let front = c * (((excess * c).powi(2) + 4.0 * v * v).sqrt() - excess * c) / (2.0 * v);
        let pressure = density * front * v - cutoff;
        let vessel = rigid(straight(1, 400, 0.1, 1.0));
        let initial = vec![-cutoff - k * excess; vessel.mesh.volume.len()];
        let eos = TensileCutoff::new(density, c, cutoff, initial);
        let constants =
            FluidConstants { linear_viscosity: 0.25, quadratic_viscosity: 1.2, ..INVISCID };
        let dt = 0.7 * vessel.stable_step(c, 0.25);
        let mut solver = Solver::new(&vessel, constants, eos, dt);
        for j in 0..=1 {
            for i in 1..=400 {
                solver.velocity.fluid_z[vessel.mesh.node(i, j)] = -v;
            }
        }
        while solver.steps as f64 * dt * front < 0.5 {
            solver.step();
        }
        let closed = solver.fluid.speed.iter().filter(|whole| **whole == 1.0).count();
        assert!((closed as f64 / 400.0 - 0.5).abs() < 0.02, "{closed}");
        let behind = solver.fluid.pressure[..150].iter().sum::<f64>() / 150.0;
        assert!((behind / pressure - 1.0).abs() < 0.02, "{behind} {pressure}");
    }
}
