//! The vessel on meshes of different fineness, and physics that can be hidden in it.
//!
//! Truths are simulated on a mesh three times as fine as the model's, with physics that the model lacks. The names that
//! a search should give are not stated here.

use lacuna_plugins::models::mercury_target::{
    Cells, EquationOfState, Gas, Mercury, Outcome, Rear, Sampling, Settings, Target, TensileCutoff,
};
use serde::Deserialize;

/// Gauges with the standard deviation of their noise in microstrain, as in `configs/sns`.
pub const SENSORS: [(&str, f64); 10] = [
    ("B", 16.0),
    ("C", 26.0),
    ("G", 7.0),
    ("M", 6.0),
    ("R", 14.0),
    ("T", 15.0),
    ("U", 28.0),
    ("V", 13.0),
    ("Y", 14.0),
    ("Z", 12.0),
];

/// The hoop gauges of the cylinder with their distances from the apex of the cap, m.
pub const HOOP: [(&str, f64); 6] =
    [("T", 0.055), ("G", 0.100), ("C", 0.150), ("U", 0.200), ("V", 0.280), ("R", 0.330)];

/// Properties of the mercury in all truths.
pub const MERCURY: Mercury =
    Mercury { density: 13_350.0, sound_speed: 1440.0, tensile_cutoff: 1.5e5 };

/// Settings with a mesh `fineness` times as fine as the model's in each direction.
pub fn settings(fineness: usize) -> Settings {
    let mut settings = Settings::default();
    settings.numerics.mesh = Cells::Explicit([10 * fineness, 45 * fineness]);
    settings.sampling = Sampling { interval: 1e-5, count: 100 };
    settings
}

/// Strain of the gauges in microstrain, all gauges concatenated.
pub fn strain(settings: &Settings, outcome: &Outcome) -> Vec<f64> {
    let row = |name: &str| settings.gauges.0.iter().position(|g| g.name == name).unwrap();
    let curve = |(name, _): &(&str, f64)| outcome.strain[row(name)].iter().map(|y| 1e6 * y);
    SENSORS.iter().flat_map(curve).collect()
}

/// Physics of a truth that the model lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Truth {
    /// Only the finer mesh.
    Mesh,
    /// Over-damped bubbles, with more towards the wall and fewer at the window.
    Bubbles,
    /// Gauge G is 12 mm behind its declared position.
    MovedGauge,
    /// The mercury ends at a rigid wall.
    RigidRear,
    /// The pressure of mercury recovers with a delay after a cavity has closed.
    LateClosing,
    /// The beam hits 22 mm off the axis.
    BesideTheAxis,
}

impl Truth {
    pub const ALL: [Self; 6] = [
        Self::Mesh,
        Self::Bubbles,
        Self::MovedGauge,
        Self::RigidRear,
        Self::LateClosing,
        Self::BesideTheAxis,
    ];

    /// Noise-free signals of the gauges, in microstrain.
    pub fn simulated(self) -> Vec<f64> {
        let mut settings = settings(3);
        match self {
            Self::MovedGauge => {
                let gauge = settings.gauges.0.iter_mut().find(|gauge| gauge.name == "G").unwrap();
                gauge.position += 0.012;
            }
            Self::RigidRear => settings.numerics.rear = Rear::Rigid,
            _ => {}
        }
        let vessel = Target::new(&settings).unwrap();
        let outcome = match self {
            Self::Bubbles => vessel.simulate_with_gas(&MERCURY, &bubbles()),
            Self::LateClosing => {
                let initial = vessel.initial_pressure(&MERCURY);
                vessel.run(MERCURY.density, LateClosing::new(&MERCURY, initial, 50e-6))
            }
            Self::BesideTheAxis => {
                let initial = beside_the_axis(&vessel, &settings, 0.022);
                vessel.run(MERCURY.density, liquid(&MERCURY, initial))
            }
            _ => vessel.simulate(&MERCURY),
        };
        strain(&settings, &outcome.unwrap())
    }
}

fn bubbles() -> Gas {
    Gas {
        void_fraction: 2e-4,
        gradient: 0.5,
        depletion: 0.4,
        bubble_radius: 8e-5,
        ..Gas::default()
    }
}

fn liquid(mercury: &Mercury, initial: Vec<f64>) -> TensileCutoff {
    let Mercury { density, sound_speed, tensile_cutoff } = *mercury;
    TensileCutoff::new(density, sound_speed, tensile_cutoff, initial)
}

/// Azimuthal mean of the pressure of a Gaussian beam whose centre is at `distance` from the axis: at radius `r` it is
/// `exp(-d²/2s²) I₀(r d/s²)` times that of the beam on the axis. The heating of the cap is unchanged.
fn beside_the_axis(vessel: &Target, settings: &Settings, distance: f64) -> Vec<f64> {
    let square = settings.pulse.width.powi(2);
    let share = |r: f64| (-0.5 * distance.powi(2) / square).exp() * bessel(r * distance / square);
    let centres = vessel.vessel().mesh.centres().map(|[r, _]| share(r));
    vessel.initial_pressure(&MERCURY).iter().zip(centres).map(|(p, s)| p * s).collect()
}

/// `I₀`, by its power series (Abramowitz and Stegun, 9.6.12).
fn bessel(x: f64) -> f64 {
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..40 {
        term *= (0.5 * x / f64::from(k)).powi(2);
        sum += term;
    }
    sum
}

/// Mercury whose cavities do not vanish at once: where one closes, the pressure above the cutoff recovers as
/// `1 - exp(-t / delay)`.
#[derive(Debug, Clone)]
struct LateClosing {
    liquid: TensileCutoff,
    cutoff: f64,
    delay: f64,
    /// Time since each cell was last cavitated, s.
    closed: Vec<f64>,
}

impl LateClosing {
    fn new(mercury: &Mercury, initial: Vec<f64>, delay: f64) -> Self {
        let closed = vec![f64::INFINITY; initial.len()];
        Self { liquid: liquid(mercury, initial), cutoff: mercury.tensile_cutoff, delay, closed }
    }
}

impl EquationOfState for LateClosing {
    fn update(
        &mut self,
        first: usize,
        strain: &[f64],
        dt: f64,
        pressure: &mut [f64],
        speed: &mut [f64],
    ) {
        self.liquid.update(first, strain, dt, pressure, speed);
        let closed = &mut self.closed[first..first + strain.len()];
        for ((p, speed), closed) in pressure.iter_mut().zip(speed).zip(closed) {
            *closed = if *speed == 0.0 { 0.0 } else { *closed + dt };
            *p = (*p + self.cutoff) * (1.0 - (-*closed / self.delay).exp()) - self.cutoff;
        }
    }

    fn sound_speed(&self) -> f64 {
        self.liquid.sound_speed()
    }

    fn stored_energy(&self, cell: usize, strain: f64) -> f64 {
        self.liquid.stored_energy(cell, strain)
    }
}

/// The radial mean of a shifted Gaussian beam, compared with the midpoint rule around the axis.
#[test]
fn the_beam_beside_the_axis_is_the_mean_around_it() {
    let (width, distance, radius) = (0.032_f64, 0.015_f64, 0.04_f64);
    let n = 200;
    let at = |k: i32| {
        let angle = std::f64::consts::TAU * (f64::from(k) + 0.5) / f64::from(n);
        let square = radius.powi(2) + distance.powi(2) - 2.0 * radius * distance * angle.cos();
        (-0.5 * square / width.powi(2)).exp()
    };
    let mean = (0..n).map(at).sum::<f64>() / f64::from(n);
    let (on, square) = ((-0.5 * radius.powi(2) / width.powi(2)).exp(), width.powi(2));
    let ours = on * (-0.5 * distance.powi(2) / square).exp() * bessel(radius * distance / square);
    assert!((ours / mean - 1.0).abs() < 1e-12, "{ours} {mean}");
}
