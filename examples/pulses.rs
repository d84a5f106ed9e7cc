//! Records of one simulated pulse as ten gauges might have measured it many times: code shared by the programs that
//! make the data of `configs/sns` and `configs/sns-helium`.

use lacuna::math::random::normal;
use rand::Rng;

/// Sampling interval of the simulated truth, s: fine enough to shift curves by a fraction of a microsecond.
pub const STEP: f64 = 1e-6;

/// Gain and timing jitter.
pub struct Jitter {
    /// Relative standard deviation of the gain: common to all gauges of a pulse, and of each gauge.
    pub gain: [f64; 2],
    /// Standard deviation of the shift in time, s: common to all gauges of a pulse, and of each gauge.
    pub shift: [f64; 2],
}

impl Jitter {
    /// Relative gain and shift common to all gauges of a pulse.
    pub fn common(&self, rng: &mut impl Rng) -> [f64; 2] {
        [self.gain[0] * normal(rng), self.shift[0] * normal(rng)]
    }

    /// Gain, as a factor, and shift of one gauge.
    pub fn own(&self, [gain, shift]: [f64; 2], rng: &mut impl Rng) -> [f64; 2] {
        let gain = 1.0 + gain + self.gain[1] * normal(rng);
        [gain, shift + self.shift[1] * normal(rng)]
    }
}

/// Times of the measurements: 10 us to 1 ms.
pub fn times() -> impl Iterator<Item = f64> {
    (1..=100).map(|t| f64::from(t) * 1e-5)
}

/// Simulated strain at a time, by linear interpolation; zero before the pulse.
pub fn at(trace: &[f64], time: f64) -> f64 {
    let place = time / STEP - 1.0;
    if place < 0.0 {
        return trace[0] * (place + 1.0).max(0.0);
    }
    let i = (place as usize).min(trace.len() - 2);
    let share = place - i as f64;
    trace[i] * (1.0 - share) + trace[i + 1] * share
}
