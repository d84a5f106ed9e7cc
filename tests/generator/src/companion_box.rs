//! A companion of the box of liquid: the same kind of physics on a coarser grid with longer steps, with constants of its own
//! that runs identify, and terms that the box may lack.
//!
//! Pressures in cells and velocities on their faces, by leapfrog. The grid's dispersion differs from that of the box, and its
//! cavities open elsewhere: the companion is wrong by some per cent of the response.

/// Cells along and across.
const NX: usize = 36;
const NY: usize = 6;

const LENGTH: f64 = 0.60;
const HEIGHT: f64 = 0.12;
const DX: f64 = LENGTH / NX as f64;
const DY: f64 = HEIGHT / NY as f64;

/// Steps between samples, which are 1e-5 s apart, and samples.
const FINE: usize = 2;
const SAMPLES: usize = 100;
const STEP: f64 = 1e-5 / FINE as f64;

/// Peak of the initial pressure, Pa.
const PEAK: f64 = 1.2e6;

/// Gauges: wall (top, bottom, front, rear) and place along it, as a share of its length.
const GAUGES: [(usize, f64); 10] = [
    (0, 0.10),
    (0, 0.28),
    (0, 0.47),
    (0, 0.66),
    (0, 0.85),
    (1, 0.20),
    (1, 0.52),
    (1, 0.80),
    (2, 0.50),
    (3, 0.50),
];

/// The inputs: names, the values without which the companion has no answer, and what they are. The first three are those of
/// the box.
pub const INPUTS: [(&str, f64, &str); 33] = [
    ("tensile_limit", f64::NAN, "pressure at which the liquid tears, Pa"),
    ("density", f64::NAN, "density, kg/m3"),
    ("sound_speed", f64::NAN, "sound speed, m/s"),
    ("heat", 1.0, "initial pressure over the nominal one"),
    ("gain", 1.0, "strain over the displacement of a wall at a radius of 0.35 m"),
    ("top_mass", 60.0, "mass of the top, kg/m2"),
    ("bottom_mass", 60.0, "mass of the bottom, kg/m2"),
    ("front_mass", 90.0, "mass of the front, kg/m2"),
    ("rear_mass", 90.0, "mass of the rear, kg/m2"),
    ("top_frequency", 1e4, "frequency of the top, rad/s"),
    ("bottom_frequency", 1e4, "frequency of the bottom, rad/s"),
    ("front_frequency", 1e4, "frequency of the front, rad/s"),
    ("rear_frequency", 1e4, "frequency of the rear, rad/s"),
    ("wall_damping", 0.04, "damping ratio of the walls"),
    ("bending", 0.5, "stiffness of bending between wall cells, in units of their own"),
    ("smoothing", 0.1, "bulk viscosity, in units of density, sound speed and width of a cell"),
    ("damping", 0.0, "friction of the liquid everywhere, 1/s"),
    ("damping_front", 0.0, "friction ahead of the middle, 1/s"),
    ("damping_rear", 0.0, "friction behind the middle, 1/s"),
    ("damping_last", 0.0, "friction behind 0.75 of the length, 1/s"),
    ("screen_1", 0.0, "loss of a screen at 0.19 of the length"),
    ("screen_2", 0.0, "loss of a screen at 0.375 of the length"),
    ("screen_3", 0.0, "loss of a screen at 0.565 of the length"),
    ("screen_4", 0.0, "loss of a screen at 0.755 of the length"),
    ("gas", 0.0, "missing share of the stiffness everywhere"),
    ("gas_front", 0.0, "missing share of the stiffness ahead of the middle"),
    ("gas_rear", 0.0, "missing share of the stiffness behind the middle"),
    ("gas_last", 0.0, "missing share of the stiffness behind 0.75 of the length"),
    ("rear_stiffness", 0.0, "further stiffness of the rear wall, in units of its own"),
    ("front_stiffness", 0.0, "further stiffness of the front wall, in units of its own"),
    ("square_friction", 0.0, "friction with the square of the speed, 1/m"),
    ("late_cavities", 0.0, "time that cavities take to open, s"),
    ("shear", 0.0, "viscosity, m2/s"),
];

struct Liquid {
    limit: f64,
    density: f64,
    /// Stiffness, Pa, and friction, 1/s, of each cell.
    stiffness: Vec<f64>,
    friction: Vec<f64>,
    /// Time since the pressure of each cell fell below the limit, s.
    open: Vec<f64>,
    /// Time that cavities take to open, s.
    late: f64,
    square_friction: f64,
    viscosity: f64,
    /// Linear bulk viscosity, in units of density, sound speed and width of a cell.
    smoothing: f64,
    speed: f64,
    /// The loss of a screen at each face along the box.
    screens: Vec<f64>,
    /// Pressure of each cell without the limit, Pa; row by row.
    pressure: Vec<f64>,
    /// Velocity across the left face of each cell and of the rear wall, m/s: `(NX + 1) x NY`.
    along: Vec<f64>,
    /// Velocity across the lower face of each cell and of the top, m/s: `NX x (NY + 1)`.
    across: Vec<f64>,
    /// Displacement and velocity of the wall cells: top, bottom, front, rear.
    moving: [Vec<[f64; 2]>; 4],
    /// Mass, frequency and further stiffness of the walls: top, bottom, front, rear.
    walls: [[f64; 3]; 4],
    wall_damping: f64,
    bending: f64,
    /// Peak of the initial pressure, Pa, and strain over displacement, 1/m.
    peak: f64,
    gain: f64,
}

/// The samples of all gauges in turn, in microstrain, for the values of [`INPUTS`].
pub fn response(inputs: &[f64]) -> Vec<f64> {
    let mut liquid = Liquid::new(inputs);
    let mut curves = vec![Vec::with_capacity(SAMPLES); GAUGES.len()];
    for step in 0..=FINE * (SAMPLES - 1) {
        if step > 0 {
            liquid.advance();
        }
        if step % FINE == 0 {
            for (curve, gauge) in curves.iter_mut().zip(GAUGES) {
                curve.push(liquid.strain(gauge));
            }
        }
    }
    curves.concat()
}

fn place(i: usize) -> f64 {
    (i as f64 + 0.5) / NX as f64
}

impl Liquid {
    fn new(inputs: &[f64]) -> Self {
        let get = |name: &str| {
            let place = INPUTS.iter().position(|(own, ..)| *own == name);
            place.map_or(f64::NAN, |place| inputs[place])
        };
        let sum = |name: &str, x: f64| {
            let half = if x < 0.5 { "front" } else { "rear" };
            let last = if x > 0.75 { get(&format!("{name}_last")) } else { 0.0 };
            get(name) + get(&format!("{name}_{half}")) + last
        };
        let plain = get("density") * get("sound_speed").powi(2);
        let xs = || (0..NX * NY).map(|cell| place(cell % NX));
        let mut screens = vec![0.0; NX + 1];
        for (name, x) in
            [("screen_1", 0.19), ("screen_2", 0.375), ("screen_3", 0.565), ("screen_4", 0.755)]
        {
            screens[(x * NX as f64).round() as usize] = get(name);
        }
        let wall = |name: &str, further: f64| {
            [get(&format!("{name}_mass")), get(&format!("{name}_frequency")), further]
        };
        let mut liquid = Self {
            limit: get("tensile_limit"),
            density: get("density"),
            stiffness: xs().map(|x| plain * (1.0 - sum("gas", x)).max(0.05)).collect(),
            friction: xs().map(|x| sum("damping", x)).collect(),
            open: vec![0.0; NX * NY],
            late: get("late_cavities"),
            square_friction: get("square_friction"),
            viscosity: get("shear"),
            smoothing: get("smoothing"),
            speed: get("sound_speed"),
            screens,
            pressure: vec![0.0; NX * NY],
            along: vec![0.0; (NX + 1) * NY],
            across: vec![0.0; NX * (NY + 1)],
            moving: [NX, NX, NY, NY].map(|n| vec![[0.0; 2]; n]),
            walls: [
                wall("top", 0.0),
                wall("bottom", 0.0),
                wall("front", get("front_stiffness")),
                wall("rear", get("rear_stiffness")),
            ],
            wall_damping: get("wall_damping"),
            bending: get("bending"),
            peak: get("heat") * PEAK * plain / (13_000.0 * 1450.0 * 1450.0),
            gain: get("gain") / 0.35,
        };
        liquid.heat();
        liquid
    }

    fn heat(&mut self) {
        for cell in 0..NX * NY {
            let (x, y) = (place(cell % NX), ((cell / NX) as f64 + 0.5) / NY as f64);
            let across = (-((y - 0.5) / 0.35).powi(2)).exp();
            let along = (-x / 0.35).exp() * (1.0 - (-x / 0.06).exp());
            self.pressure[cell] = self.peak * across * along;
        }
    }

    /// The rate at which the volume of a cell grows, 1/s.
    fn growth(&self, cell: usize) -> f64 {
        let face = cell + cell / NX;
        (self.along[face + 1] - self.along[face]) / DX
            + (self.across[cell + NX] - self.across[cell]) / DY
    }

    fn advance(&mut self) {
        let viscosity = self.smoothing * self.density * self.speed * DX;
        let acts = |cell: usize| {
            let p = self.pressure[cell];
            let p = if self.open[cell] >= self.late { p.max(-self.limit) } else { p };
            p - viscosity * self.growth(cell)
        };
        let acting: Vec<f64> = (0..NX * NY).map(acts).collect();
        for face in 0..self.along.len() {
            let (i, j) = (face % (NX + 1), face / (NX + 1));
            if i > 0 && i < NX {
                let [left, right] = [j * NX + i - 1, j * NX + i];
                let kick = STEP * (acting[left] - acting[right]) / (DX * self.density);
                let friction = 0.5 * (self.friction[left] + self.friction[right]);
                let slowed = self.slowed(self.along[face] + kick, friction);
                self.along[face] = slowed / (1.0 + self.screens[i]);
            }
        }
        for face in NX..NX * NY {
            let kick = STEP * (acting[face - NX] - acting[face]) / (DY * self.density);
            self.across[face] = self.slowed(self.across[face] + kick, self.friction[face]);
        }
        if self.viscosity > 0.0 {
            self.diffuse();
        }
        self.move_walls(&acting);
        for cell in 0..NX * NY {
            self.pressure[cell] -= STEP * self.stiffness[cell] * self.growth(cell);
            let torn = self.pressure[cell] < -self.limit;
            self.open[cell] = if torn { self.open[cell] + STEP } else { 0.0 };
        }
    }

    fn slowed(&self, velocity: f64, friction: f64) -> f64 {
        velocity * (1.0 - friction * STEP) / (1.0 + self.square_friction * velocity.abs() * STEP)
    }

    /// Diffuses the velocities along the box over a step.
    fn diffuse(&mut self) {
        let old = self.along.clone();
        for face in 0..old.len() {
            let i = face % (NX + 1);
            if i > 0 && i < NX {
                let bend = old[face - 1] + old[face + 1] - 2.0 * old[face];
                self.along[face] += STEP * self.viscosity * bend / (DX * DX);
            }
        }
    }

    fn move_walls(&mut self, acting: &[f64]) {
        for (side, [mass, frequency, further]) in self.walls.into_iter().enumerate() {
            let stiffness = mass * frequency * frequency * (1.0 + further);
            let loss = 2.0 * self.wall_damping * mass * frequency;
            let old = self.moving[side].clone();
            for (k, &[w, v]) in old.iter().enumerate() {
                let (cell, face) = match side {
                    0 => ((NY - 1) * NX + k, NY * NX + k),
                    1 => (k, k),
                    2 => (k * NX, k * (NX + 1)),
                    _ => (k * NX + NX - 1, k * (NX + 1) + NX),
                };
                let at = |i: usize| old.get(i).map_or(w, |cell| cell[0]);
                let bend = at(k.wrapping_sub(1)) + at(k + 1) - 2.0 * w;
                let force = acting[cell] - stiffness * (w - self.bending * bend) - loss * v;
                let v = v + STEP * force / mass;
                self.moving[side][k] = [w + STEP * v, v];
                let faces = if side < 2 { &mut self.across } else { &mut self.along };
                faces[face] = if side == 0 || side == 3 { v } else { -v };
            }
        }
    }

    fn strain(&self, (side, share): (usize, f64)) -> f64 {
        let wall = &self.moving[side];
        let at = (share * wall.len() as f64 - 0.5).clamp(0.0, wall.len() as f64 - 1.001);
        let (k, part) = (at.floor() as usize, at.fract());
        1e6 * self.gain * (wall[k][0] * (1.0 - part) + wall[k + 1][0] * part)
    }
}
