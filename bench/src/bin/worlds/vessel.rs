//! The vessel of the mercury target as a world: its simulator, physics that can be hidden in it and that no candidate has
//! in the same form, and a coarser mesh as its companion.

use generator::world::{Change, World};
use lacuna_plugins::models::mercury_target::{
    Cells, EquationOfState, Gas, Mercury, Outcome, Sampling, Settings, SimulationError, Target,
    TensileCutoff,
};

use crate::studied::Accompanied;

/// The gauges of `configs/sns`.
const GAUGES: [&str; 10] = ["B", "C", "G", "M", "R", "T", "U", "V", "Y", "Z"];

/// The mesh of the simulator, radial and axial cells.
const MESH: [usize; 2] = [16, 72];

/// The number of fine steps between samples.
const FINE: usize = 10;

/// The length of a fine step, s.
const STEP: f64 = 1e-6;

/// The number of samples of a gauge.
const SAMPLES: usize = 100;

/// The vessel.
#[derive(Debug, Clone, Copy)]
pub struct Vessel;

/// Physics that the simulator lacks, with its size.
#[derive(Debug, Clone, Copy)]
pub enum Inside {
    /// Helium in pressure equilibrium, more towards the wall and less at the window: volume fraction.
    Helium(f64),
    /// Bubbles of 80 µm that follow the pressure with a delay: volume fraction.
    Bubbles(f64),
    /// All motion decays, 1/s.
    Damping(f64),
    /// The rear end reflects this share of the pressure.
    Reflection(f64),
    /// The pressure recovers this late after a cavity has closed, s.
    LateClosing(f64),
    /// The beam hits this far off the axis, m.
    BesideTheAxis(f64),
    /// The gauge C is this far behind its place, m.
    Moved(f64),
    /// The cylinder's wall is thicker by this share, the cap's is not.
    ThickCylinder(f64),
    /// The steel is softer by this share.
    SoftSteel(f64),
    /// The energy is deposited deeper: the decay length is longer by this share.
    Deeper(f64),
    /// The window is curved less: its radius of curvature is larger by this share.
    FlatWindow(f64),
}

impl World for Vessel {
    type Inside = Inside;

    fn parameters(&self) -> Vec<(&'static str, [f64; 2], f64)> {
        vec![
            ("tensile_cutoff", [0.0, 4.0e5], 2.0e5),
            ("density", [13_000.0, 13_600.0], 13_300.0),
            ("sound_speed", [1390.0, 1490.0], 1440.0),
        ]
    }

    fn sensors(&self) -> Vec<&'static str> {
        GAUGES.to_vec()
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

    fn times(&self) -> Vec<f64> {
        (1..=SAMPLES).map(|i| STEP * (FINE * i) as f64).collect()
    }

    fn sampled(&self, fine: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let samples = |curve: &Vec<f64>| -> Vec<f64> {
            curve.iter().skip(FINE - 1).step_by(FINE).copied().collect()
        };
        fine.iter().map(samples).collect()
    }

    fn curves(&self, parameters: &[f64], inside: &[Inside], _condition: usize) -> Vec<Vec<f64>> {
        let mut settings = Settings::default();
        settings.numerics.mesh = Cells::Explicit(MESH);
        settings.sampling = Sampling { interval: STEP, count: FINE * SAMPLES };
        let &[tensile_cutoff, density, sound_speed] = parameters else {
            unreachable!("three parameters")
        };
        let mercury = Mercury { tensile_cutoff, density, sound_speed };
        for physics in inside {
            physics.set(&mut settings);
        }
        let run = || -> Result<Vec<Vec<f64>>, SimulationError> {
            let target = Target::new(&settings)?;
            let outcome = simulated(&target, &settings, &mercury, inside)?;
            Ok(strain(&settings, &outcome))
        };
        // A size at which the model fails is too large: the search for a size turns back from curves that are no numbers.
        run().unwrap_or_else(|_| vec![vec![f64::NAN; FINE * SAMPLES]; GAUGES.len()])
    }

    fn changes(&self) -> Vec<Change<Inside>> {
        vec![
            Change::new("stratified helium", Inside::Helium, 1e-7, 3e-3),
            Change::new("late bubbles", Inside::Bubbles, 1e-7, 3e-3),
            Change::new("damping", Inside::Damping, 1.0, 2e4),
            Change::new("reflecting rear end", Inside::Reflection, 1e-3, 0.99),
            Change::new("late closing", Inside::LateClosing, 1e-7, 3e-4),
            Change::new("beam beside the axis", Inside::BesideTheAxis, 1e-4, 0.06),
            Change::new("moved gauge", Inside::Moved, 1e-5, 0.04),
            Change::new("thick cylinder", Inside::ThickCylinder, 1e-4, 1.0),
            Change::new("soft steel", Inside::SoftSteel, 1e-4, 0.6),
            Change::new("deeper deposition", Inside::Deeper, 1e-4, 3.0),
            Change::new("flat window", Inside::FlatWindow, 1e-4, 3.0),
        ]
    }
}

impl Inside {
    /// Changes the settings, if the physics is one of them.
    fn set(self, settings: &mut Settings) {
        match self {
            Self::Damping(rate) => settings.damping = rate,
            Self::Reflection(share) => settings.rear_reflection = share,
            Self::Moved(distance) => {
                let gauges = settings.gauges.0.iter_mut();
                gauges.filter(|own| own.name == "C").for_each(|own| own.position += distance);
            }
            Self::ThickCylinder(share) => settings.wall.cylinder_thickness *= 1.0 + share,
            Self::SoftSteel(share) => settings.wall.young_modulus *= 1.0 - share,
            Self::Deeper(share) => settings.pulse.decay *= 1.0 + share,
            Self::FlatWindow(share) => settings.geometry.cap_radius *= 1.0 + share,
            Self::Helium(_) | Self::Bubbles(_) | Self::LateClosing(_) | Self::BesideTheAxis(_) => {}
        }
    }
}

/// A run with the physics that is no setting; two of them at once do not occur.
fn simulated(
    target: &Target,
    settings: &Settings,
    mercury: &Mercury,
    inside: &[Inside],
) -> Result<Outcome, SimulationError> {
    let special = inside.iter().find_map(|physics| match *physics {
        Inside::Helium(void_fraction) => {
            let gas = Gas {
                void_fraction,
                gradient: 0.5,
                depletion: 0.4,
                bubble_radius: 0.0,
                ..Gas::default()
            };
            Some(target.simulate_with_gas(mercury, &gas))
        }
        Inside::Bubbles(void_fraction) => {
            let gas = Gas { void_fraction, bubble_radius: 8e-5, ..Gas::default() };
            Some(target.simulate_with_gas(mercury, &gas))
        }
        Inside::LateClosing(delay) => {
            let late = LateClosing::new(mercury, target.initial_pressure(mercury), delay);
            Some(target.run(mercury.density, late))
        }
        Inside::BesideTheAxis(distance) => {
            let initial = beside_the_axis(target, settings, mercury, distance);
            Some(target.run(mercury.density, liquid(mercury, initial)))
        }
        _ => None,
    });
    special.unwrap_or_else(|| target.simulate(mercury))
}

/// The strain of the gauges in the order of [`GAUGES`].
fn strain(settings: &Settings, outcome: &Outcome) -> Vec<Vec<f64>> {
    let named = settings.gauges.0.iter().zip(&outcome.strain);
    let curve = |name: &&str| -> Vec<f64> {
        let own = named.clone().find(|(gauge, _)| gauge.name == **name);
        own.map_or(Vec::new(), |(_, strain)| strain.clone())
    };
    GAUGES.iter().map(curve).collect()
}

fn liquid(mercury: &Mercury, initial: Vec<f64>) -> TensileCutoff {
    let Mercury { density, sound_speed, tensile_cutoff } = *mercury;
    TensileCutoff::new(density, sound_speed, tensile_cutoff, initial)
}

/// Azimuthal mean of the pressure of a Gaussian beam whose centre is at `distance` from the axis: at radius `r` it is
/// `exp(-d²/2s²) I₀(r d/s²)` times that of the beam on the axis. The heating of the cap is unchanged.
fn beside_the_axis(
    target: &Target,
    settings: &Settings,
    mercury: &Mercury,
    distance: f64,
) -> Vec<f64> {
    let square = settings.pulse.width.powi(2);
    let share = |r: f64| (-0.5 * distance.powi(2) / square).exp() * bessel(r * distance / square);
    let centres = target.vessel().mesh.centres().map(|[r, _]| share(r));
    target.initial_pressure(mercury).iter().zip(centres).map(|(p, s)| p * s).collect()
}

/// `I₀`, by its power series (Abramowitz and Stegun, 9.6.12).
fn bessel(x: f64) -> f64 {
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..60 {
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

impl Accompanied for Vessel {
    /// The same vessel on a coarser mesh. It has helium without stratification and in equilibrium, damping, a rear end that
    /// reflects, the thickness of the whole wall, and the beam's energy and width.
    fn companion(&self) -> String {
        r#"
[gap.companion]
use = "mercury_target_equilibrium_gas"
numerics = { mesh = [14, 63] }
fixed = { void_fraction = 0.0, void_gradient = 0.0, void_depletion = 0.0 }

[[gap.companion.switch]]
input = "void_fraction"
prior = { half_normal = 5e-5 }

[[gap.companion.switch]]
input = "damping"
prior = { half_normal = 500.0 }

[[gap.companion.switch]]
input = "rear_reflection"
prior = { normal = [0.0, 0.4] }

[[gap.companion.switch]]
input = "wall_thickness"
prior = { normal = [1.0, 0.05] }

[[gap.companion.switch]]
input = "pulse_energy"
prior = { normal = [1.0, 0.05] }

[[gap.companion.switch]]
input = "beam_width"
prior = { normal = [0.032, 0.003] }

[[gap.candidate]]
use = "misplacement"
distance = { normal = [0.0, 0.01] }
positions = { T = 0.055, G = 0.10, C = 0.15, U = 0.20, V = 0.28, R = 0.33 }
unit = "m"
"#
        .to_owned()
    }

    fn degree(&self) -> usize {
        12
    }

    fn units(&self) -> Vec<&'static str> {
        vec!["Pa", "kg/m3", "m/s"]
    }
}
