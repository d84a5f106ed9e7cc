//! Noise of replicates: a first-order autoregression plus an offset of the whole replicate.

use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

/// Coefficient of the autoregression.
const MEMORY: f64 = 0.5;

/// Standard deviation of a replicate's offset relative to that of its noise.
const OFFSET: f64 = 0.3;

/// Random numbers.
#[derive(Debug)]
pub struct Source(ChaCha8Rng);

impl Source {
    /// A source with this seed.
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// A uniform number.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// A standard normal number (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let (u, v): (f64, f64) = (1.0 - self.0.random::<f64>(), self.0.random());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    /// Plus or minus one.
    pub fn sign(&mut self) -> f64 {
        if self.0.random::<bool>() { 1.0 } else { -1.0 }
    }
}

/// One replicate of some curves: all sensors concatenated.
pub fn replicate(curves: &[Vec<f64>], sd: &[f64], random: &mut Source) -> Vec<f64> {
    let mut all = Vec::new();
    for (curve, sd) in curves.iter().zip(sd) {
        let offset = OFFSET * sd * random.normal();
        let mut noise = random.normal();
        for y in curve {
            all.push(y + offset + sd * noise);
            noise = MEMORY * noise + (1.0 - MEMORY * MEMORY).sqrt() * random.normal();
        }
    }
    all
}
