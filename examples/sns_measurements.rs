//! Makes the measured data of `configs/sns`: `cargo run --release -p lacuna-examples --bin sns_measurements`.
//!
//! The strain measured at the SNS target is not public. These curves come from the stand-in model `mercury_target` on a
//! mesh three times as fine in each direction as the study's, at the founding paper's MAP (arXiv 2202.03959), with the
//! scatter between pulses that the paper describes: gain and timing jitter, noise, larger for U and C and small for G
//! and M, and a few curves of white noise. All chosen values are written to `measurements.json` beside the data; no
//! study reads it.

mod pulses;

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use lacuna::math::random::{Stream, normal};
use lacuna_plugins::models::mercury_target::{Cells, Mercury, Sampling, Settings, simulate};
use serde_json::json;

use pulses::{Jitter, STEP, at, times};

const SEED: u64 = 1_004_056;
const JITTER: Jitter = Jitter { gain: [0.02, 0.03], shift: [1.0e-6, 1.0e-6] };
/// Gauge, number of intact curves, standard deviation of the noise in microstrain.
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
        let common = JITTER.common(&mut common);
        for (g, (gauge, curves, noise)) in GAUGES.iter().enumerate() {
            let faulty = FAULTY.iter().find(|(p, name, _)| *p as u64 == pulse && name == gauge);
            let before = FAULTY.iter().filter(|(p, name, _)| (*p as u64) < pulse && name == gauge);
            let number = pulse as usize - before.count();
            if number > *curves {
                continue;
            }
            let row = names.iter().position(|name| name == gauge).ok_or("an unknown gauge")?;
            let mut own = root.named("gauge").at(pulse).at(g as u64).generator();
            let [gain, shift] = JITTER.own(common, &mut own);
            for time in times() {
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
        "gain sd: common, own": JITTER.gain,
        "time shift sd [s]: common, own": JITTER.shift,
        "gauges: name, sound curves, noise sd [microstrain]": GAUGES,
        "faulty: pulse, gauge, sd [microstrain]": FAULTY,
    });
    std::fs::write(folder.join("measurements.json"), format!("{record:#}\n"))?;
    Ok(())
}
