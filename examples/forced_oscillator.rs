//! Makes the data of `configs/forced_oscillator`: `cargo run --release -p lacuna-examples --bin forced_oscillator`,
//! with optional arguments after `--`: the number of points of the longer record and another folder.
//!
//! A mass on a spring and a damper under a measured force. The force is linear between its samples, so the motion
//! between two samples is known in closed form, and no integrator is involved.

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use lacuna::math::random::{Stream, normal};

const SEED: u64 = 20_261_122;
/// True values in kg, kg/s, N/m.
const TRUTH: Oscillator = Oscillator { mass: 2.0, damping: 1.6, stiffness: 80.0 };
/// Standard deviation of the noise, mm.
const NOISE: f64 = 0.5;
/// Number of points of the longer record.
const POINTS: usize = 20_000;

/// Settings of a record; times in seconds.
struct Record {
    name: &'static str,
    /// Number of points as a fraction of that of the longest record.
    share: f64,
    interval: f64,
    /// Sampling interval of the force in s, its standard deviation in N, and its correlation time in s.
    force: (f64, f64, f64),
}

const RECORDS: [Record; 2] = [
    Record { name: "weak", share: 1.0, interval: 0.01, force: (0.008, 1.0, 0.1) },
    Record { name: "strong", share: 0.7, interval: 0.0125, force: (0.01, 3.0, 0.05) },
];

struct Oscillator {
    mass: f64,
    damping: f64,
    stiffness: f64,
}

impl Oscillator {
    /// Position and velocity a time `while_` after the force was `force` and began to change at the rate `slope`: the
    /// linear particular solution `(F - c s / k) / k` plus a decaying vibration.
    fn after(&self, [x, v]: [f64; 2], force: f64, slope: f64, while_: f64) -> [f64; 2] {
        let Self { mass, damping, stiffness } = self;
        let straight = |t: f64| (force + slope * t - damping * slope / stiffness) / stiffness;
        let (decay, speed) = (0.5 * damping / mass, slope / stiffness);
        let frequency = (stiffness / mass - decay * decay).sqrt();
        let (a, w) = (x - straight(0.0), v - speed);
        let b = (w + decay * a) / frequency;
        let (sin, cos) = (frequency * while_).sin_cos();
        let fade = (-decay * while_).exp();
        let turned = frequency * (b * cos - a * sin) - decay * (a * cos + b * sin);
        [fade * (a * cos + b * sin) + straight(while_), fade * turned + speed]
    }

    /// Positions at increasing times after rest at time zero, when the force has its first sample.
    fn positions(&self, interval: f64, force: &[f64], times: &[f64]) -> Vec<f64> {
        let (mut state, mut piece) = ([0.0, 0.0], 0);
        let slope = |piece: usize| (force[piece + 1] - force[piece]) / interval;
        let mut positions = Vec::with_capacity(times.len());
        for &time in times {
            while (piece + 1) as f64 * interval < time {
                state = self.after(state, force[piece], slope(piece), interval);
                piece += 1;
            }
            let since = time - piece as f64 * interval;
            positions.push(self.after(state, force[piece], slope(piece), since)[0]);
        }
        positions
    }
}

/// An autoregressive force: each sample is a multiple of the last one plus a normal number, rounded as in the file.
fn force(count: usize, (interval, sd, memory): (f64, f64, f64), stream: &Stream) -> Vec<f64> {
    let mut rng = stream.generator();
    let share = (-interval / memory).exp();
    let mut now = 0.0;
    let mut next = || {
        now = share * now + (1.0 - share * share).sqrt() * sd * normal(&mut rng);
        (1e4 * now).round() / 1e4
    };
    (0..count).map(|_| next()).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let points = arguments.next().map_or(Ok(POINTS), |text| text.parse())?;
    let own = concat!(env!("CARGO_MANIFEST_DIR"), "/../configs/forced_oscillator");
    let folder = arguments.next().unwrap_or_else(|| own.to_owned());
    for (number, record) in RECORDS.iter().enumerate() {
        let random = Stream::root(SEED).at(number as u64);
        let count = (record.share * points as f64).round() as usize;
        let times: Vec<f64> = (1..=count).map(|i| i as f64 * record.interval).collect();
        let interval = record.force.0;
        let samples = 2 + (count as f64 * record.interval / interval).ceil() as usize;
        let force = force(samples, record.force, &random.named("force"));
        let mut table = "time [s],force [N]\n".to_owned();
        for (i, force) in force.iter().enumerate() {
            writeln!(table, "{:.3},{force:.4}", i as f64 * interval)?;
        }
        let mut noise = random.named("noise").generator();
        let mut measured = "replicate,time [s],position [mm]\n".to_owned();
        for (time, position) in times.iter().zip(TRUTH.positions(interval, &force, &times)) {
            writeln!(measured, "1,{time:.4},{:.3}", 1e3 * position + NOISE * normal(&mut noise))?;
        }
        let folder = Path::new(&folder);
        std::fs::write(folder.join(format!("force-{}.csv", record.name)), table)?;
        std::fs::write(folder.join(format!("position-{}.csv", record.name)), measured)?;
    }
    Ok(())
}
