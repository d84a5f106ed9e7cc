//! Makes the measured data of `configs/sns-fatigue`: `cargo run --release -p lacuna-examples --bin fatigue_measurements`.
//!
//! Twenty pulses at four targets of one design, five at each, as in the founding paper (arXiv 2202.03959), where they are
//! targets T24, T26, T27 and T28. The targets differ in the stiffness of the mercury by 1 % (standard deviation), which
//! gas and temperature may change: in its sound speed by half of that. Everything else is as for `configs/sns`, without
//! faulty curves. `truth.csv` has the strain of each target without noise, and of a fifth target at one and two times the
//! energy of the pulse: what the study predicts.

mod gauges;
mod pulses;

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use lacuna::math::random::{Stream, normal};
use lacuna_plugins::models::mercury_target::{Cells, Mercury, Sampling, Settings, simulate};
use serde_json::json;

use gauges::GAUGES;
use pulses::{Jitter, STEP, at, times};

const SEED: u64 = 2_024_262_728;
const JITTER: Jitter = Jitter { gain: [0.02, 0.03], shift: [1.0e-6, 1.0e-6] };
const MERCURY: Mercury = Mercury { density: 12_112.1, sound_speed: 1850.4, tensile_cutoff: 6.45e4 };
/// Relative standard deviation of the stiffness between targets.
const SCATTER: f64 = 0.01;
const PULSES: u64 = 5;
/// The measured targets, and a further one of which only the truth is written.
const TARGETS: [&str; 5] = ["T24", "T26", "T27", "T28", "next"];
const MEASURED: usize = 4;

fn main() -> Result<(), Box<dyn Error>> {
    let root = Stream::root(SEED);
    let mut text = "scenario,replicate,sensor,time [s],strain [microstrain]\n".to_owned();
    let mut truth = "target,pulse_energy,sensor,time [s],strain [microstrain]\n".to_owned();
    let mut speeds = Vec::new();
    for (number, target) in TARGETS.iter().enumerate() {
        let mut rng = root.named("target").at(number as u64).generator();
        let stiffness = 1.0 + SCATTER * normal(&mut rng);
        let mercury = Mercury { sound_speed: MERCURY.sound_speed * stiffness.sqrt(), ..MERCURY };
        speeds.push((target, mercury.sound_speed));
        let curves = strain(&mercury, 1.0)?;
        tell(&mut truth, target, 1.0, &curves)?;
        if number < MEASURED {
            measure(&mut text, target, &curves, &root.named("pulse").at(number as u64))?;
        } else {
            tell(&mut truth, target, 2.0, &strain(&mercury, 2.0)?)?;
        }
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/sns-fatigue");
    std::fs::write(folder.join("strain.csv"), text)?;
    std::fs::write(folder.join("truth.csv"), truth)?;
    let record = json!({
        "what": "how strain.csv and truth.csv were made; no study reads this file",
        "program": "examples/fatigue_measurements.rs",
        "seed": SEED,
        "model": "mercury_target, mesh of 60 x 270 cells, other settings at their defaults",
        "density [kg/m3]": MERCURY.density,
        "tensile_cutoff [Pa]": MERCURY.tensile_cutoff,
        "mean sound speed [m/s]": MERCURY.sound_speed,
        "relative sd of the stiffness between targets": SCATTER,
        "sound_speed [m/s] of each target": speeds,
        "gain sd: common, own": JITTER.gain,
        "time shift sd [s]: common, own": JITTER.shift,
        "gauges: name, noise sd [microstrain]": GAUGES,
    });
    std::fs::write(folder.join("measurements.json"), format!("{record:#}\n"))?;
    Ok(())
}

/// The strain at each of [`GAUGES`], sampled at multiples of [`STEP`], for a pulse of this relative energy.
fn strain(mercury: &Mercury, energy: f64) -> Result<Vec<Vec<f64>>, Box<dyn Error>> {
    let mut settings = Settings::default();
    settings.numerics.mesh = Cells::Explicit([60, 270]);
    settings.sampling = Sampling { interval: STEP, count: 1020 };
    settings.pulse.peak_pressure *= energy;
    settings.pulse.wall_strain *= energy;
    let all = simulate(&settings, mercury)?.strain;
    let row = |name: &str| settings.gauges.0.iter().position(|gauge| gauge.name == name);
    let own = |(name, _): &(&str, f64)| row(name).map(|i| all[i].clone());
    GAUGES.iter().map(own).collect::<Option<_>>().ok_or_else(|| "an unknown gauge".into())
}

/// Writes the strain of a target without noise.
fn tell(
    text: &mut String,
    target: &str,
    energy: f64,
    curves: &[Vec<f64>],
) -> Result<(), std::fmt::Error> {
    for ((gauge, _), curve) in GAUGES.iter().zip(curves) {
        for time in times() {
            writeln!(text, "{target},{energy},{gauge},{time:.5},{:.3}", 1e6 * at(curve, time))?;
        }
    }
    Ok(())
}

/// Writes what the gauges would have measured at each pulse.
fn measure(
    text: &mut String,
    target: &str,
    curves: &[Vec<f64>],
    stream: &Stream,
) -> Result<(), std::fmt::Error> {
    for pulse in 1..=PULSES {
        let pulses = stream.at(pulse);
        let common = JITTER.common(&mut pulses.generator());
        for (g, ((gauge, noise), curve)) in GAUGES.iter().zip(curves).enumerate() {
            let mut own = pulses.at(g as u64).generator();
            let [gain, shift] = JITTER.own(common, &mut own);
            for time in times() {
                let value = 1e6 * gain * at(curve, time - shift) + noise * normal(&mut own);
                writeln!(text, "{target},{target}-{pulse},{gauge},{time:.5},{value:.2}")?;
            }
        }
    }
    Ok(())
}
