//! Makes the measured data of `configs/external`: `cargo run --release -p lacuna-examples --bin vessel_measurements`.
//!
//! Strains of the program `vessel` at known parameters, with independent normal noise.

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use lacuna::math::random::{Stream, normal};
use lacuna_plugins::models::mercury_target::{Cells, Mercury, Sampling, Settings, simulate};

const SEED: u64 = 20_261_121;
const TRUTH: Mercury = Mercury { density: 12_800.0, sound_speed: 1600.0, tensile_cutoff: 3.0e5 };
const GAUGES: [&str; 3] = ["B", "C", "U"];
const REPLICATES: u64 = 5;
/// Standard deviation of the noise, microstrain.
const NOISE: f64 = 20.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mut settings = Settings::default();
    settings.numerics.mesh = Cells::Explicit([8, 36]);
    settings.sampling = Sampling { interval: 1e-5, count: 20 };
    let outcome = simulate(&settings, &TRUTH)?;
    let mut text = "replicate,sensor,time [s],strain [microstrain]\n".to_owned();
    for replicate in 1..=REPLICATES {
        let mut noise = Stream::root(SEED).at(replicate).generator();
        for gauge in GAUGES {
            let row = settings.gauges.0.iter().position(|known| known.name == gauge);
            let strains = &outcome.strain[row.ok_or("an unknown gauge")?];
            for (time, strain) in outcome.times.iter().zip(strains) {
                let strain = 1e6 * strain + NOISE * normal(&mut noise);
                writeln!(text, "{replicate},{gauge},{time:.5},{strain:.2}")?;
            }
        }
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/external");
    std::fs::write(folder.join("strain.csv"), text)?;
    Ok(())
}
