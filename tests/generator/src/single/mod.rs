//! Single records of small systems whose model lacks one physics: one sensor, no replicates.
//!
//! Each record is the solution of the system with the missing physics, integrated by the classical fourth-order
//! Runge-Kutta method, plus the noise of an instrument. Half of the missing physics has a form that a library of terms
//! can have, half has not: other powers, other laws, sums.

mod instrument;
mod law;
mod misfit;
mod missing;
mod system;
#[cfg(test)]
mod tests;

use crate::noise::Source;

pub use instrument::{Instrument, Stated};
pub use law::Law;
pub use system::{Kind, Parameter, System};

/// Number of integration steps between two values of a record.
const FINE: usize = 24;

/// Range of the number of values of a record.
const LENGTHS: [f64; 2] = [60.0, 600.0];

/// Range of the misfit after calibration, root mean square, in standard deviations of the noise.
const RATIOS: [f64; 2] = [2.0, 20.0];

/// Range of the noise of a record without missing physics, relative to the record's standard deviation.
const QUIET: [f64; 2] = [0.003, 0.03];

/// Physics that a record has and the model lacks.
#[derive(Debug, Clone, PartialEq)]
pub struct Missing {
    /// Name.
    pub name: &'static str,
    /// The laws, each with its coefficient.
    pub laws: Vec<(Law, f64)>,
    /// The types of terms that are together this physics; empty if none is, or if nothing is missing.
    pub exact: &'static [&'static str],
    /// The types of terms that are nearly this physics.
    pub near: &'static [&'static str],
}

/// A record with its answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// The system.
    pub system: System,
    /// True parameters.
    pub truth: Vec<f64>,
    /// Physics that the model lacks.
    pub missing: Missing,
    /// The instrument.
    pub instrument: Instrument,
    /// The times.
    pub times: Vec<f64>,
    /// The measured values.
    pub values: Vec<f64>,
    /// Standard deviation of the noise of one value.
    pub sd: f64,
    /// Standard deviation of the record itself.
    pub spread: f64,
    /// Root mean square of the misfit that the parameters cannot absorb, to first order, in standard deviations of the
    /// noise; zero if nothing is missing.
    pub ratio: f64,
}

/// Number of different cases: systems with their missing physics.
pub fn kinds() -> usize {
    System::all().iter().map(|system| missing::missing(system.kind).len()).sum()
}

/// The record number `index` of a seed. Systems and missing physics follow one another; instruments and sizes are drawn.
pub fn record(seed: u64, index: usize) -> Record {
    let mut random = Source::new(1_000_003 * seed + index as u64);
    let (system, physics) = nth(index % kinds());
    let count = log_uniform(&mut random, LENGTHS).round() as usize;
    let instrument = Instrument::drawn(index / kinds() + index, &mut random);
    let truth: Vec<f64> = system.parameters().iter().map(|p| p.drawn(&mut random)).collect();
    let times = system.times(count);
    let plain = system.solution(&truth, &[], &times, FINE);
    let laws: Vec<(Law, f64)> = physics
        .laws
        .iter()
        .map(|(law, share)| {
            (*law, share * random.uniform(0.7, 1.4) * system.scale(*law, &truth, &times))
        })
        .collect();
    let missing = Missing { name: physics.name, laws, exact: physics.exact, near: physics.near };
    let exact = system.solution(&truth, &missing.laws, &times, FINE);
    let spread = deviation(&exact);
    let (sd, ratio) = if missing.laws.is_empty() {
        (spread * log_uniform(&mut random, QUIET), 0.0)
    } else {
        let rest = misfit::beside_parameters(system, &truth, &times, &exact, &plain);
        let ratio = log_uniform(&mut random, RATIOS);
        (rest / ratio, ratio)
    };
    let step = times[1] - times[0];
    let values = instrument.measured(&exact, sd, spread, step, &mut random);
    Record { system, truth, missing, instrument, times, values, sd, spread, ratio }
}

/// The system and the missing physics of this number.
fn nth(mut number: usize) -> (System, Missing) {
    for system in System::all() {
        let all = missing::missing(system.kind);
        if number < all.len() {
            return (system, all[number].clone());
        }
        number -= all.len();
    }
    unreachable!("the number is below `kinds`")
}

fn log_uniform(random: &mut Source, [low, high]: [f64; 2]) -> f64 {
    low * (high / low).powf(random.uniform(0.0, 1.0))
}

fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
}
