//! Makes the measured data of `configs/sns-helium`: `cargo run --release -p lacuna-examples --bin helium_measurements`.
//!
//! The strain measured at the SNS target with helium is not public. These curves come from the stand-in model with
//! over-damped bubbles on a mesh three times as fine in each direction as the study's, at values chosen here, with a
//! scatter between pulses: gain and timing jitter, and white noise. All chosen values are written to
//! `measurements.json` beside the data; no study reads it.

mod pulses;

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use lacuna::math::random::{Stream, normal};
use lacuna_plugins::models::mercury_target::{Cells, Gas, Mercury, Sampling, Settings, Target};
use serde_json::json;

use pulses::{Jitter, STEP, at, times};

const SEED: u64 = 20_230_511;
const PULSES: u64 = 10;
const JITTER: Jitter = Jitter { gain: [0.01, 0.02], shift: [5e-7, 5e-7] };
/// Standard deviation of the noise, microstrain.
const NOISE: f64 = 8.0;
/// Damping rate of all motion, 1/s.
const DAMPING: f64 = 180.0;
/// Energy of the pulse relative to the default.
const PULSE_ENERGY: f64 = 1.03;
/// Standard deviation of the beam profile, m.
const BEAM_WIDTH: f64 = 0.0332;

fn main() -> Result<(), Box<dyn Error>> {
    let mercury = Mercury { density: 13_420.0, sound_speed: 1437.0, tensile_cutoff: 2.1e5 };
    let gas = Gas {
        void_fraction: 2.4e-4,
        gradient: 0.3,
        depletion: 0.4,
        bubble_radius: 9e-5,
        ..Gas::default()
    };
    let mut settings = Settings { damping: DAMPING, ..Settings::default() };
    settings.numerics.mesh = Cells::Explicit([60, 270]);
    settings.sampling = Sampling { interval: STEP, count: 1010 };
    settings.pulse.peak_pressure *= PULSE_ENERGY;
    settings.pulse.wall_strain *= PULSE_ENERGY;
    settings.pulse.width = BEAM_WIDTH;
    let truth = Target::new(&settings)?.simulate_with_gas(&mercury, &gas)?.strain;

    let mut text = "replicate,sensor,time [s],strain [microstrain]\n".to_owned();
    let root = Stream::root(SEED);
    for pulse in 1..=PULSES {
        let mut common = root.named("pulse").at(pulse).generator();
        let common = JITTER.common(&mut common);
        for (g, (gauge, trace)) in settings.gauges.0.iter().zip(&truth).enumerate() {
            let mut own = root.named("gauge").at(pulse).at(g as u64).generator();
            let [gain, shift] = JITTER.own(common, &mut own);
            for time in times() {
                let strain = 1e6 * gain * at(trace, time - shift) + NOISE * normal(&mut own);
                writeln!(text, "{pulse},{},{time:.5},{strain:.1}", gauge.name)?;
            }
        }
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/sns-helium");
    std::fs::write(folder.join("strain.csv"), text)?;
    let record = json!({
        "what": "how strain.csv was made; no study reads this file",
        "program": "examples/helium_measurements.rs",
        "seed": SEED,
        "model": "mercury_target_bubbles, mesh of 60 x 270 cells, other settings at their defaults",
        "density [kg/m3]": mercury.density,
        "sound_speed [m/s]": mercury.sound_speed,
        "tensile_cutoff [Pa]": mercury.tensile_cutoff,
        "void_fraction": gas.void_fraction,
        "void_gradient": gas.gradient,
        "void_depletion": gas.depletion,
        "bubble_radius [m]": gas.bubble_radius,
        "damping [1/s]": DAMPING,
        "pulse_energy": PULSE_ENERGY,
        "beam_width [m]": BEAM_WIDTH,
        "gain sd: common, own": JITTER.gain,
        "time shift sd [s]: common, own": JITTER.shift,
        "noise sd [microstrain]": NOISE,
    });
    std::fs::write(folder.join("measurements.json"), format!("{record:#}\n"))?;
    Ok(())
}
