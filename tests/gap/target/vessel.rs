//! The vessel on meshes of different fineness. Truths are simulated on a mesh three times as fine as the model's.

use lacuna_plugins::models::mercury_target::{Cells, Mercury, Outcome, Sampling, Settings, Target};

#[path = "../../../examples/gauges.rs"]
mod gauges;

pub use gauges::GAUGES as SENSORS;

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

/// Noise-free signals of the gauges on the fine mesh, in microstrain; gauge G is `moved` behind its declared position, m.
pub fn truth(moved: f64) -> Vec<f64> {
    let mut settings = settings(3);
    let gauge = settings.gauges.0.iter_mut().find(|gauge| gauge.name == "G").unwrap();
    gauge.position += moved;
    strain(&settings, &Target::new(&settings).unwrap().simulate(&MERCURY).unwrap())
}
