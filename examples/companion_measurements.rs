//! Makes the measured data of `configs/sns-companion`: `cargo run --release -p lacuna-examples --bin companion_measurements`.
//!
//! Each study has physics that its simulator lacks: helium, damping, a rear end that reflects, a gauge beside its place.
//! The curves come from the stand-in model with that physics, on a mesh twice as fine in each direction as that of the
//! study's simulation runs. All chosen values are written to `measurements.json`, which no study reads.

mod gauges;
mod pulses;

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use lacuna::math::random::{Stream, normal};
use lacuna_plugins::models::mercury_target::{Cells, Gas, Mercury, Sampling, Settings, Target};
use serde_json::json;

use gauges::GAUGES;
use pulses::{Jitter, STEP, at, times};

const SEED: u64 = 20_261_124;
const PULSES: u64 = 8;
const JITTER: Jitter = Jitter { gain: [0.003, 0.003], shift: [1e-7, 1e-7] };
/// Correlation between the noise of neighbouring values.
const MEMORY: f64 = 0.4;
const MERCURY: Mercury = Mercury { density: 13_420.0, sound_speed: 1437.0, tensile_cutoff: 1.7e5 };
const VOID_FRACTION: f64 = 1.5e-5;
const DAMPING: f64 = 250.0;
const REFLECTION: f64 = 0.4;
const MOVED: (&str, f64) = ("C", 0.012);

fn main() -> Result<(), Box<dyn Error>> {
    for name in ["helium", "damping", "rear_end", "gauge"] {
        write(name, &strain(name)?)?;
    }
    let record = json!({
        "what": "how the tables of strain were made; no study reads this file",
        "program": "examples/companion_measurements.rs",
        "seed": SEED,
        "model": "mercury_target, mesh of 40 x 180 cells, other settings at their defaults",
        "density [kg/m3]": MERCURY.density,
        "sound_speed [m/s]": MERCURY.sound_speed,
        "tensile_cutoff [Pa]": MERCURY.tensile_cutoff,
        "helium: void_fraction": VOID_FRACTION,
        "damping [1/s]": DAMPING,
        "rear_end: rear_reflection": REFLECTION,
        "gauge: name, distance behind its place [m]": MOVED,
        "gain sd: common, own": JITTER.gain,
        "time shift sd [s]: common, own": JITTER.shift,
        "correlation of neighbouring noise": MEMORY,
        "gauges: name, noise sd [microstrain]": GAUGES,
    });
    std::fs::write(folder().join("measurements.json"), format!("{record:#}\n"))?;
    Ok(())
}

fn folder() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/sns-companion")
}

/// The strain of the gauges with the hidden physics of a study, at steps of a microsecond.
fn strain(name: &str) -> Result<Vec<Vec<f64>>, Box<dyn Error>> {
    let mut settings = Settings::default();
    settings.numerics.mesh = Cells::Explicit([40, 180]);
    settings.sampling = Sampling { interval: STEP, count: 1010 };
    match name {
        "damping" => settings.damping = DAMPING,
        "rear_end" => settings.rear_reflection = REFLECTION,
        "gauge" => {
            let moved = settings.gauges.0.iter_mut().find(|gauge| gauge.name == MOVED.0);
            moved.ok_or("no such gauge")?.position += MOVED.1;
        }
        _ => {}
    }
    let names: Vec<String> = settings.gauges.0.iter().map(|gauge| gauge.name.clone()).collect();
    let target = Target::new(&settings)?;
    let outcome = if name == "helium" {
        let gas = Gas { void_fraction: VOID_FRACTION, bubble_radius: 0.0, ..Gas::default() };
        target.simulate_with_gas(&MERCURY, &gas)?
    } else {
        target.simulate(&MERCURY)?
    };
    let row = |gauge: &str| names.iter().position(|name| name == gauge).ok_or("an unknown gauge");
    GAUGES.iter().map(|(gauge, _)| Ok(outcome.strain[row(gauge)?].clone())).collect()
}

/// Writes the pulses of a study.
fn write(name: &str, strain: &[Vec<f64>]) -> Result<(), Box<dyn Error>> {
    let mut text = "replicate,sensor,time [s],strain [microstrain]\n".to_owned();
    let root = Stream::root(SEED).named(name);
    for pulse in 1..=PULSES {
        let mut common = root.named("pulse").at(pulse).generator();
        let common = JITTER.common(&mut common);
        for (g, ((gauge, sd), trace)) in GAUGES.iter().zip(strain).enumerate() {
            let mut own = root.named("gauge").at(pulse).at(g as u64).generator();
            let [gain, shift] = JITTER.own(common, &mut own);
            let mut noise = normal(&mut own);
            for time in times() {
                let value = 1e6 * gain * at(trace, time - shift) + sd * noise;
                writeln!(text, "{pulse},{gauge},{time:.5},{value:.1}")?;
                noise = MEMORY * noise + (1.0 - MEMORY * MEMORY).sqrt() * normal(&mut own);
            }
        }
    }
    std::fs::write(folder().join(format!("{name}.csv")), text)?;
    Ok(())
}
