//! Makes the measured data of `configs/sns`: `cargo run --release -p lacuna-examples --bin sns_measurements`.
//!
//! The strain measured at the SNS target is not public. These curves come from the stand-in model
//! `mercury_target` on a mesh three times as fine in each direction as the study's, at the founding paper's MAP
//! (arXiv 2202.03959), with the scatter from pulse to pulse that the paper describes: gain and timing jitter,
//! noise, larger for U and C and small for G and M, and a few curves of white noise. Everything that
//! was chosen is written to `measurements.json` beside the data; no study reads it.

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use lacuna::math::random::{Stream, normal};
use lacuna_plugins::models::mercury_target::{Cells, Mercury, Sampling, Settings, simulate};
use serde_json::json;

const SEED: u64 = 1_004_056;
/// Sampling of the simulated truth, s: fine enough to shift curves by a fraction of a microsecond.
const STEP: f64 = 1e-6;
/// Times of the measurements: 10 us to 1 ms.
const TIMES: usize = 100;
const INTERVAL: f64 = 1e-5;
/// Relative standard deviation of the gain, common to all gauges of a pulse and of each gauge.
const GAIN: [f64; 2] = [0.02, 0.03];
/// Standard deviation of the shift in time, s, common and of each gauge.
const JITTER: [f64; 2] = [1.0e-6, 1.0e-6];
/// Gauge, number of sound curves, standard deviation of the noise in microstrain.
const GAUGES: [(&str, usize, f64); 10] = [
    ("B", 20, 16.0),
    ("C", 20, 26.0),
    ("G", 20, 7.0),
    ("M", 20, 6.0),
    ("R", 20, 14.0),
    ("T", 20, 15.0),
    ("U", 15, 28.0),
    ("V", 15, 13.0),
    ("Y", 15, 14.0),
    ("Z", 15, 12.0),
];
/// Faulty curves: pulse, gauge, standard deviation of the white noise in microstrain.
const FAULTY: [(usize, &str, f64); 4] =
    [(7, "B", 160.0), (12, "T", 140.0), (12, "V", 120.0), (9, "U", 170.0)];

fn main() -> Result<(), Box<dyn Error>> {
    let mercury = Mercury { density: 12_112.1, sound_speed: 1850.4, tensile_cutoff: 6.45e4 };
    let mut settings = Settings::default();
    settings.numerics.mesh = Cells::Explicit([60, 270]);
    settings.sampling = Sampling { interval: STEP, count: 1020 };
    let truth = simulate(&settings, &mercury)?.strain;
    let names: Vec<&str> = settings.gauges.0.iter().map(|gauge| gauge.name.as_str()).collect();

    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/sns");
    let mut text = "replicate,sensor,time [s],strain [microstrain]\n".to_owned();
    let root = Stream::root(SEED);
    for pulse in 1..=22 {
        let mut common = root.named("pulse").at(pulse).generator();
        let (gain, shift) = (GAIN[0] * normal(&mut common), JITTER[0] * normal(&mut common));
        for (g, (gauge, curves, noise)) in GAUGES.iter().enumerate() {
            let faulty = FAULTY.iter().find(|(p, name, _)| *p as u64 == pulse && name == gauge);
            let before = FAULTY.iter().filter(|(p, name, _)| (*p as u64) < pulse && name == gauge);
            let number = pulse as usize - before.count();
            if number > *curves {
                continue;
            }
            let row = names.iter().position(|name| name == gauge).ok_or("an unknown gauge")?;
            let mut own = root.named("gauge").at(pulse).at(g as u64).generator();
            let gain = 1.0 + gain + GAIN[1] * normal(&mut own);
            let shift = shift + JITTER[1] * normal(&mut own);
            for t in 1..=TIMES {
                let time = t as f64 * INTERVAL;
                let strain = match faulty {
                    Some((_, _, sd)) => sd * normal(&mut own),
                    None => 1e6 * gain * at(&truth[row], time - shift) + noise * normal(&mut own),
                };
                writeln!(text, "{pulse},{gauge},{time:.5},{strain:.2}")?;
            }
        }
    }
    std::fs::write(folder.join("strain.csv"), text)?;
    let record = json!({
        "what": "how strain.csv was made; no study reads this file",
        "program": "examples/sns_measurements.rs",
        "seed": SEED,
        "model": "mercury_target, mesh of 60 x 270 cells, other settings at their defaults",
        "density [kg/m3]": mercury.density,
        "sound_speed [m/s]": mercury.sound_speed,
        "tensile_cutoff [Pa]": mercury.tensile_cutoff,
        "gain sd: common, own": GAIN,
        "time shift sd [s]: common, own": JITTER,
        "gauges: name, sound curves, noise sd [microstrain]": GAUGES,
        "faulty: pulse, gauge, sd [microstrain]": FAULTY,
    });
    std::fs::write(folder.join("measurements.json"), format!("{record:#}\n"))?;
    Ok(())
}

/// The simulated strain at a time, by linear interpolation; zero before the pulse.
fn at(trace: &[f64], time: f64) -> f64 {
    let place = time / STEP - 1.0;
    if place < 0.0 {
        return trace[0] * (place + 1.0).max(0.0);
    }
    let i = (place as usize).min(trace.len() - 2);
    let share = place - i as f64;
    trace[i] * (1.0 - share) + trace[i + 1] * share
}
