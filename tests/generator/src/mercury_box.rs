//! A box of liquid in an elastic shell: plane acoustics on a staggered grid, a tensile limit of the liquid, walls that
//! are oscillators, ten gauges on the walls; and physics that acts inside, which the model lacks.
//!
//! The leapfrog scheme is that of Yee (IEEE Transactions on Antennas and Propagation 14 (1966) 302), as acoustics use
//! it; a wall cell moves by `m w'' + r w' + k w = p`.

use crate::world::{Change, World};

/// Cells along and across the box.
const NX: usize = 48;
const NY: usize = 10;

/// Length and height of the box, m.
const LENGTH: f64 = 0.60;
const HEIGHT: f64 = 0.12;

/// Time step, s; the Courant number stays below 0.9 for speeds up to 2000 m/s.
const STEP: f64 = 2.5e-6;

/// Time steps between samples.
const FINE: usize = 4;

/// Number of samples, 1e-5 s apart.
const SAMPLES: usize = 100;

/// Peak of the initial pressure, Pa.
const PEAK: f64 = 1.2e6;

/// Linear bulk viscosity, in units of density, sound speed and width of a cell: collapsing cavities would ring at the
/// grid's own frequency without it.
const VISCOSITY: f64 = 0.12;

/// Surface mass, kg/m2, frequency, 1/s, and damping ratio of the walls: top, bottom, front, rear.
const WALLS: [[f64; 3]; 4] =
    [[55.0, 9.0e3, 0.03], [70.0, 7.5e3, 0.03], [90.0, 1.4e4, 0.05], [80.0, 1.1e4, 0.05]];

/// Radius that turns a wall's displacement into strain, m.
const RADIUS: f64 = 0.35;

/// Gauges: wall and place along it, as a share of its length.
const GAUGES: [(&str, usize, f64); 10] = [
    ("g1", 0, 0.10),
    ("g2", 0, 0.28),
    ("g3", 0, 0.47),
    ("g4", 0, 0.66),
    ("g5", 0, 0.85),
    ("g6", 1, 0.20),
    ("g7", 1, 0.52),
    ("g8", 1, 0.80),
    ("g9", 2, 0.50),
    ("g10", 3, 0.50),
];

/// Physics inside the box that the model lacks; the number is its size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Inside {
    /// Friction of the liquid everywhere, 1/s.
    Friction(f64),
    /// Friction of the liquid in the rear half, 1/s.
    RearFriction(f64),
    /// A screen across the box at 0.4 of its length that stops this share of the flow.
    Screen(f64),
    /// Gas in the last third: this share of the stiffness is missing, and waves are damped.
    Gas(f64),
    /// The rear wall is stiffer by this share.
    RigidRear(f64),
    /// Friction with the square of the speed, 1/m.
    QuadraticFriction(f64),
    /// A limit that opens this late after the pressure falls below it, s.
    LateCavities(f64),
    /// A gauge this far from its place, m.
    Moved(f64),
}

/// The box as a world: the parameters are the tensile limit, the density and the sound speed.
#[derive(Debug, Clone, Copy)]
pub struct MercuryBox;

impl World for MercuryBox {
    type Inside = Inside;

    fn parameters(&self) -> Vec<(&'static str, [f64; 2], f64)> {
        vec![
            ("tensile_limit", [1.0e5, 5.0e5], 3.0e5),
            ("density", [12_000.0, 14_000.0], 13_000.0),
            ("sound_speed", [1350.0, 1550.0], 1450.0),
        ]
    }

    fn sensors(&self) -> Vec<&'static str> {
        GAUGES.map(|(name, ..)| name).to_vec()
    }

    fn fine(&self) -> usize {
        FINE
    }

    fn step(&self) -> f64 {
        STEP
    }

    fn samples(&self) -> usize {
        SAMPLES
    }

    fn noise_share(&self) -> f64 {
        0.05
    }

    fn curves(&self, parameters: &[f64], inside: &[Inside], _condition: usize) -> Vec<Vec<f64>> {
        Liquid::new(parameters, inside).run()
    }

    fn changes(&self) -> Vec<Change<Inside>> {
        vec![
            Change::new("damping everywhere", Inside::Friction, 1.0, 20_000.0),
            Change::new("damping in the rear", Inside::RearFriction, 1.0, 40_000.0),
            Change::new("screen", Inside::Screen, 0.001, 1.0),
            Change::new("gas in the rear", Inside::Gas, 0.001, 0.9),
            Change::new("rigid rear wall", Inside::RigidRear, 0.001, 100.0),
            Change::new("quadratic friction", Inside::QuadraticFriction, 0.1, 1e6),
            Change::new("late cavities", Inside::LateCavities, 1e-6, 3e-4),
            Change::new("moved gauge", Inside::Moved, 1e-4, 0.08),
        ]
    }
}

/// The state of the liquid and the walls.
struct Liquid<'a> {
    inside: &'a [Inside],
    limit: f64,
    density: f64,
    speed: f64,
    /// Stiffness of each cell, Pa.
    stiffness: Vec<f64>,
    /// Pressure of each cell without the tensile limit, Pa; row by row.
    pressure: Vec<f64>,
    /// Time since the pressure fell below the limit, s.
    open: Vec<f64>,
    /// Velocity across the left face of each cell, and of the right wall: `(NX + 1) x NY`.
    along: Vec<f64>,
    /// Velocity across the lower face of each cell, and of the upper wall: `NX x (NY + 1)`.
    across: Vec<f64>,
    /// Displacement and velocity of the wall cells: top, bottom, front, rear.
    walls: [Vec<[f64; 2]>; 4],
}

impl<'a> Liquid<'a> {
    fn new(parameters: &[f64], inside: &'a [Inside]) -> Self {
        let [limit, density, speed] = [parameters[0], parameters[1], parameters[2]];
        let gas: f64 = inside.iter().map(|i| if let Inside::Gas(s) = i { *s } else { 0.0 }).sum();
        let mut pressure = vec![0.0; NX * NY];
        let mut stiffness = vec![density * speed * speed; NX * NY];
        for j in 0..NY {
            for i in 0..NX {
                let [x, y] = place(i, j);
                let shape = (-((y - 0.5) / 0.35).powi(2)).exp()
                    * (-x / 0.35).exp()
                    * (1.0 - (-x / 0.06).exp());
                // Heating of a liquid of this stiffness.
                pressure[j * NX + i] =
                    PEAK * shape * stiffness[j * NX + i] / (13_000.0 * 1450.0 * 1450.0);
                if x > 2.0 / 3.0 {
                    stiffness[j * NX + i] *= 1.0 - gas;
                }
            }
        }
        let cells = [NX, NX, NY, NY];
        Self {
            inside,
            limit,
            density,
            speed,
            stiffness,
            open: vec![0.0; NX * NY],
            pressure,
            along: vec![0.0; (NX + 1) * NY],
            across: vec![0.0; NX * (NY + 1)],
            walls: cells.map(|n| vec![[0.0; 2]; n]),
        }
    }

    /// The pressure that acts: not below the limit.
    fn acting(&self, cell: usize) -> f64 {
        let late: f64 = self
            .inside
            .iter()
            .map(|i| if let Inside::LateCavities(t) = i { *t } else { 0.0 })
            .sum();
        let p = self.pressure[cell];
        if p < -self.limit && self.open[cell] >= late { -self.limit } else { p }
    }

    fn run(mut self) -> Vec<Vec<f64>> {
        let mut curves = vec![Vec::new(); GAUGES.len()];
        for step in 0..=FINE * (SAMPLES - 1) {
            if step > 0 {
                self.advance();
            }
            for (curve, gauge) in curves.iter_mut().zip(GAUGES) {
                curve.push(self.strain(gauge));
            }
        }
        curves
    }

    fn advance(&mut self) {
        let [dx, dy] = [LENGTH / NX as f64, HEIGHT / NY as f64];
        let viscosity = VISCOSITY * self.density * self.speed * dx;
        let acting: Vec<f64> = (0..NX * NY)
            .map(|cell| self.acting(cell) - viscosity * self.divergence(cell))
            .collect();
        for j in 0..NY {
            for i in 1..NX {
                let force = (acting[j * NX + i - 1] - acting[j * NX + i]) / dx;
                let face = j * (NX + 1) + i;
                self.along[face] = self.slowed(self.along[face], force, i as f64 / NX as f64, i);
            }
        }
        for j in 1..NY {
            for i in 0..NX {
                let force = (acting[(j - 1) * NX + i] - acting[j * NX + i]) / dy;
                let face = j * NX + i;
                self.across[face] =
                    self.slowed(self.across[face], force, (i as f64 + 0.5) / NX as f64, usize::MAX);
            }
        }
        self.move_walls(&acting);
        let open_from = -self.limit;
        for j in 0..NY {
            for i in 0..NX {
                let cell = j * NX + i;
                let flow = self.divergence(cell);
                self.pressure[cell] -= STEP * self.stiffness[cell] * flow;
                if self.pressure[cell] < open_from {
                    self.open[cell] += STEP;
                } else {
                    self.open[cell] = 0.0;
                }
            }
        }
    }

    /// The rate at which the volume of a cell grows, 1/s.
    fn divergence(&self, cell: usize) -> f64 {
        let (i, j) = (cell % NX, cell / NX);
        let face = j * (NX + 1) + i;
        (self.along[face + 1] - self.along[face]) / (LENGTH / NX as f64)
            + (self.across[cell + NX] - self.across[cell]) / (HEIGHT / NY as f64)
    }

    /// The velocity after a step under a pressure gradient, with what slows it at this share of the length.
    fn slowed(&self, velocity: f64, force: f64, x: f64, face: usize) -> f64 {
        let mut v = velocity + STEP * force / self.density;
        for physics in self.inside {
            match *physics {
                Inside::Friction(a) => v *= (-a * STEP).exp(),
                Inside::RearFriction(a) if x > 0.5 => v *= (-a * STEP).exp(),
                Inside::Gas(s) if x > 2.0 / 3.0 => v *= (-3000.0 * s * STEP).exp(),
                Inside::QuadraticFriction(a) => v /= 1.0 + a * v.abs() * STEP,
                Inside::Screen(s) if face == NX * 2 / 5 => v *= (-s / (1.001 - s) * 0.05).exp(),
                _ => {}
            }
        }
        v
    }

    fn move_walls(&mut self, acting: &[f64]) {
        let rigid: f64 =
            self.inside.iter().map(|i| if let Inside::RigidRear(s) = i { *s } else { 0.0 }).sum();
        for (side, [mass, frequency, ratio]) in WALLS.into_iter().enumerate() {
            let stiffness =
                mass * frequency * frequency * if side == 3 { 1.0 + rigid } else { 1.0 };
            let loss = 2.0 * ratio * mass * frequency;
            for k in 0..self.walls[side].len() {
                let cell = match side {
                    0 => (NY - 1) * NX + k,
                    1 => k,
                    2 => k * NX,
                    _ => k * NX + NX - 1,
                };
                let [w, v] = self.walls[side][k];
                // Neighbouring wall cells pull at each other.
                let at = |i: usize| self.walls[side].get(i).map_or(w, |c| c[0]);
                let bend = at(k.wrapping_sub(1)) + at(k + 1) - 2.0 * w;
                let force = acting[cell] - stiffness * w - loss * v + 1.5 * stiffness * bend;
                let v = v + STEP * force / mass;
                self.walls[side][k] = [w + STEP * v, v];
                match side {
                    0 => self.across[NY * NX + k] = v,
                    1 => self.across[k] = -v,
                    2 => self.along[k * (NX + 1)] = -v,
                    _ => self.along[k * (NX + 1) + NX] = v,
                }
            }
        }
    }

    /// The strain at a gauge, in microstrain: interpolated between wall cells.
    fn strain(&self, (name, side, share): (&str, usize, f64)) -> f64 {
        let moved: f64 = self
            .inside
            .iter()
            .map(|i| if let (Inside::Moved(m), "g3") = (i, name) { *m } else { 0.0 })
            .sum();
        let wall = &self.walls[side];
        let length = if side < 2 { LENGTH } else { HEIGHT };
        let at = ((share + moved / length) * wall.len() as f64 - 0.5)
            .clamp(0.0, wall.len() as f64 - 1.001);
        let (k, part) = (at.floor() as usize, at.fract());
        1e6 * (wall[k][0] * (1.0 - part) + wall[k + 1][0] * part) / RADIUS
    }
}

/// The middle of a cell, as shares of length and height.
fn place(i: usize, j: usize) -> [f64; 2] {
    [(i as f64 + 0.5) / NX as f64, (j as f64 + 0.5) / NY as f64]
}
