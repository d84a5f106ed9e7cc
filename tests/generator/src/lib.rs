//! Generator of measured data in which an effect is hidden.
//!
//! It shares no code with the engine or its plugins: truths are integrated by another scheme, filtered and shifted at
//! ten times the sampling rate, and noise is made with other random numbers. The answer is in [`Case::hidden`], which
//! only the last assertion of a test should use.

pub mod chain;
pub mod companion_box;
pub mod companion_pipe;
pub mod hidden;
pub mod line;
pub mod mercury_box;
pub mod noise;
pub mod oscillator;
pub mod pipe;
pub mod single;
pub mod world;

pub use chain::{Chain, PARAMETERS, REFERENCE};
pub use hidden::{Hidden, Kind};

/// Sensors of the chain.
pub const SENSORS: [&str; 4] = ["x1", "x2", "v1", "a2"];

/// Number of samples of a curve.
pub const SAMPLES: usize = 100;

/// Number of fine steps between samples.
pub const FINE: usize = 10;

/// Time between samples, s.
pub const STEP: f64 = 0.1;

/// Curves at fine sampling by sensor: `FINE * (SAMPLES - 1) + 1` values each.
pub type Fine = Vec<Vec<f64>>;

/// Measured data with the answer.
#[derive(Debug, Clone)]
pub struct Case {
    /// True parameters.
    pub truth: [f64; 4],
    /// Hidden effects.
    pub hidden: Vec<Hidden>,
    /// Replicates by condition; each holds the curves of all sensors, concatenated.
    pub replicates: Vec<Vec<Vec<f64>>>,
}

/// Times of the samples, s.
pub fn times() -> Vec<f64> {
    (0..SAMPLES).map(|i| STEP * i as f64).collect()
}

/// Standard deviation of one replicate's noise on each sensor: 5 % of the root mean square of its curve.
pub fn noise_sd() -> [f64; 4] {
    let mut square = [0.0; 4];
    for condition in 0..chain::CONDITIONS {
        let curves = sampled(&Chain::plain(REFERENCE).curves(condition));
        for (sum, curve) in square.iter_mut().zip(&curves) {
            *sum += curve.iter().map(|y| y * y).sum::<f64>();
        }
    }
    square.map(|sum| 0.05 * (sum / (SAMPLES * chain::CONDITIONS) as f64).sqrt())
}

/// Samples of fine curves.
pub fn sampled(fine: &Fine) -> Vec<Vec<f64>> {
    fine.iter().map(|curve| curve.iter().step_by(FINE).copied().collect()).collect()
}

/// Data of some replicates with hidden effects, each of a size that changes its sensors' curves by `ratio` times the
/// noise of one replicate (root mean square, before any calibration).
pub fn case(seed: u64, kinds: &[(Kind, Vec<usize>)], ratio: f64, replicates: usize) -> Case {
    let mut random = noise::Source::new(seed);
    let mut truth = REFERENCE;
    for x in &mut truth {
        *x *= 1.0 + 0.05 * random.normal().clamp(-2.0, 2.0);
    }
    let sd = noise_sd();
    let hidden: Vec<Hidden> = kinds
        .iter()
        .map(|(kind, sensors)| Hidden::sized(*kind, sensors, truth, &sd, ratio, &mut random))
        .collect();
    let replicates = (0..chain::CONDITIONS)
        .map(|condition| {
            let curves = sampled(&hidden::curves(&hidden, truth, condition));
            (0..replicates).map(|_| noise::replicate(&curves, &sd, &mut random)).collect()
        })
        .collect();
    Case { truth, hidden, replicates }
}
