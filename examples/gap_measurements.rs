//! Makes the measured data of `configs/sns-gap`: `cargo run --release -p lacuna-examples --bin gap_measurements`.
//!
//! The strain measured at the SNS target with helium is not public. These curves come from the stand-in model with
//! over-damped bubbles, stratified, on a mesh three times as fine in each direction as the study's: physics that the
//! study's model fixes at zero. Pulses differ by gain, offset and timing, common to all gauges and of each gauge, and
//! by autocorrelated noise. All chosen values are written to `measurements.json` beside the data: the answer key, which
//! no study reads.

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

const SEED: u64 = 20_240_917;
const PULSES: u64 = 16;
const JITTER: Jitter = Jitter { gain: [0.015, 0.015], shift: [5e-7, 5e-7] };
/// Standard deviation of the offset of each gauge between pulses, microstrain.
const OFFSET: f64 = 2.0;
/// Correlation between the noise of neighbouring values.
const MEMORY: f64 = 0.4;

fn main() -> Result<(), Box<dyn Error>> {
    let mercury = Mercury { density: 13_350.0, sound_speed: 1440.0, tensile_cutoff: 1.5e5 };
    let gas = Gas {
        void_fraction: 2e-4,
        gradient: 0.5,
        depletion: 0.4,
        bubble_radius: 8e-5,
        ..Gas::default()
    };
    let mut settings = Settings::default();
    settings.numerics.mesh = Cells::Explicit([60, 270]);
    settings.sampling = Sampling { interval: STEP, count: 1010 };
    let truth = Target::new(&settings)?.simulate_with_gas(&mercury, &gas)?.strain;
    let names: Vec<&str> = settings.gauges.0.iter().map(|gauge| gauge.name.as_str()).collect();

    let mut text = "replicate,sensor,time [s],strain [microstrain]\n".to_owned();
    let root = Stream::root(SEED);
    for pulse in 1..=PULSES {
        let mut common = root.named("pulse").at(pulse).generator();
        let common = JITTER.common(&mut common);
        for (g, (gauge, sd)) in GAUGES.iter().enumerate() {
            let row = names.iter().position(|name| name == gauge).ok_or("an unknown gauge")?;
            let mut own = root.named("gauge").at(pulse).at(g as u64).generator();
            let [gain, shift] = JITTER.own(common, &mut own);
            let offset = OFFSET * normal(&mut own);
            let mut noise = normal(&mut own);
            for time in times() {
                let strain = 1e6 * gain * at(&truth[row], time - shift) + offset + sd * noise;
                writeln!(text, "{pulse},{gauge},{time:.5},{strain:.1}")?;
                noise = MEMORY * noise + (1.0 - MEMORY * MEMORY).sqrt() * normal(&mut own);
            }
        }
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/sns-gap");
    std::fs::write(folder.join("strain.csv"), text)?;
    let record = json!({
        "what": "how strain.csv was made; no study reads this file",
        "program": "examples/gap_measurements.rs",
        "seed": SEED,
        "model": "mercury_target_bubbles, mesh of 60 x 270 cells, other settings at their defaults",
        "density [kg/m3]": mercury.density,
        "sound_speed [m/s]": mercury.sound_speed,
        "tensile_cutoff [Pa]": mercury.tensile_cutoff,
        "void_fraction": gas.void_fraction,
        "void_gradient": gas.gradient,
        "void_depletion": gas.depletion,
        "bubble_radius [m]": gas.bubble_radius,
        "gain sd: common, own": JITTER.gain,
        "time shift sd [s]: common, own": JITTER.shift,
        "offset sd [microstrain]": OFFSET,
        "correlation of neighbouring noise": MEMORY,
        "gauges: name, noise sd [microstrain]": GAUGES,
        "effect": { "class": ["gas_attenuation", "void_fraction", "mercury_target_equilibrium_gas", "mercury_target_bubbles"] },
    });
    std::fs::write(folder.join("measurements.json"), format!("{record:#}\n"))?;
    Ok(())
}
