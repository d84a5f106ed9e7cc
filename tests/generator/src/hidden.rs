//! Effects hidden in data: on sensors, applied at fine sampling, and in the physics of the chain.

use crate::chain::{CONDITIONS, Chain};
use crate::noise::Source;
use crate::{FINE, Fine, STEP, sampled};

/// Kind of a hidden effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The gauge factor.
    Gain,
    /// A constant.
    Offset,
    /// A trend.
    Drift,
    /// Shift in time.
    Delay,
    /// First-order low-pass filter.
    LowPass,
    /// Weaker, delayed copy.
    Echo,
    /// An exponential loss.
    Damping,
    /// Saturation at a limit.
    Saturation,
    /// Bump of limited duration.
    SecondaryPulse,
    /// Decaying exponential from the beginning.
    Flash,
    /// Rising exponential from the beginning.
    PulseHeating,
    /// A step.
    LevelJump,
    /// A decaying oscillation.
    Resonance,
    /// Fraction of the next sensor's signal.
    Crosstalk,
    /// Drag quadratic in a speed, not on a sensor.
    Drag,
    /// Cubic stiffness.
    Cubic,
    /// Additional stiffness under tension only.
    Switching,
    /// Half sine of random width and time, under one condition: local, and not in the library.
    Burst,
    /// Every second half of the curve is slightly mirrored; not in the library.
    Rectified,
}

/// A hidden effect with its parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Hidden {
    /// Kind of the effect.
    pub kind: Kind,
    /// Indices of the sensors that it acts on.
    pub sensors: Vec<usize>,
    /// Size of the effect.
    pub size: f64,
    /// Times or frequencies of the effect.
    pub shape: [f64; 3],
}

impl Hidden {
    /// An effect of random shape and sign whose size changes its sensors' signals by `ratio` times their noise.
    pub fn sized(
        kind: Kind,
        sensors: &[usize],
        truth: [f64; 4],
        sd: &[f64; 4],
        ratio: f64,
        random: &mut Source,
    ) -> Self {
        let sign = if kind.one_sided() { 1.0 } else { random.sign() };
        let shape = random_shape(kind, random, 1.0);
        let mut hidden = Self { kind, sensors: sensors.to_vec(), size: 0.0, shape };
        let (mut low, mut high) = (0.0, 1e-3);
        let plain: [Vec<Vec<f64>>; CONDITIONS] =
            std::array::from_fn(|condition| sampled(&Chain::plain(truth).curves(condition)));
        let change = |hidden: &mut Self, size: f64| {
            hidden.size = sign * size;
            hidden.change(&plain, truth, sd)
        };
        while change(&mut hidden, high) < ratio && high < 1e4 {
            low = high;
            high *= 2.0;
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if change(&mut hidden, middle) < ratio {
                low = middle;
            } else {
                high = middle;
            }
        }
        hidden
    }

    /// Root mean square change of the affected samples from those of the plain chain, in units of the noise.
    fn change(&self, plain: &[Vec<Vec<f64>>; CONDITIONS], truth: [f64; 4], sd: &[f64; 4]) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for (condition, without) in plain.iter().enumerate() {
            if self.kind == Kind::Burst && condition as f64 != self.shape[2] {
                continue;
            }
            let with = sampled(&curves(std::slice::from_ref(self), truth, condition));
            for &s in &self.sensors {
                for (a, b) in with[s].iter().zip(&without[s]) {
                    sum += ((a - b) / sd[s]).powi(2);
                    count += 1.0;
                }
            }
        }
        (sum / count).sqrt()
    }
}

/// Random times or frequencies of an effect, for records that are `scale` times 9.9 s long.
pub fn random_shape(kind: Kind, random: &mut Source, scale: f64) -> [f64; 3] {
    match kind {
        Kind::Echo => [scale * random.uniform(0.6, 2.5), 0.0, 0.0],
        Kind::SecondaryPulse => {
            [scale * random.uniform(4.0, 8.0), scale * random.uniform(0.3, 0.8), 0.0]
        }
        Kind::Flash => [scale * random.uniform(0.4, 1.5), 0.0, 0.0],
        Kind::PulseHeating => [scale * random.uniform(0.5, 2.0), 0.0, 0.0],
        Kind::LevelJump => [scale * random.uniform(3.0, 7.0), 0.0, 0.0],
        Kind::Resonance => {
            [random.uniform(4.0, 9.0) / scale, random.uniform(0.01, 0.05), random.uniform(0.0, 6.2)]
        }
        Kind::Burst => {
            let width = random.uniform(1.0, 3.5);
            let condition = if random.sign() > 0.0 { 1.0 } else { 0.0 };
            [scale * random.uniform(0.0, 9.9 - width), scale * width, condition]
        }
        _ => [0.0; 3],
    }
}

impl Kind {
    /// Returns true if the size of the effect is positive.
    pub fn one_sided(self) -> bool {
        matches!(
            self,
            Self::LowPass
                | Self::Damping
                | Self::Saturation
                | Self::Drag
                | Self::Cubic
                | Self::Switching
                | Self::Rectified
                | Self::PulseHeating
        )
    }
}

/// The fine curve `y` of a sensor with an effect, and `other` that of the sensor that couples into it; the time `h`
/// between its values in s.
pub fn distorted(
    kind: Kind,
    size: f64,
    shape: [f64; 3],
    y: &[f64],
    other: &[f64],
    h: f64,
) -> Vec<f64> {
    let (a, [p, q, r]) = (size, shape);
    let time = |i: usize| h * i as f64;
    let before = |back: f64, i: usize| {
        let at = i as f64 - back / h;
        let low = at.floor().clamp(0.0, (y.len() - 1) as f64);
        let high = (low + 1.0).min((y.len() - 1) as f64);
        let share = (at - low).clamp(0.0, 1.0);
        y[low as usize] * (1.0 - share) + y[high as usize] * share
    };
    let mapped = |f: &dyn Fn(usize) -> f64| (0..y.len()).map(f).collect();
    match kind {
        Kind::Gain => mapped(&|i| (1.0 + a) * y[i]),
        Kind::Offset => mapped(&|i| y[i] + a),
        Kind::Drift => mapped(&|i| y[i] + a * time(i)),
        Kind::Delay => mapped(&|i| before(a, i)),
        Kind::Echo => {
            mapped(&|i| y[i] + if time(i) >= p { a * (before(p, i) - y[0]) } else { 0.0 })
        }
        Kind::Damping => mapped(&|i| y[i] * (-a * time(i)).exp()),
        Kind::Saturation => mapped(&|i| (a * y[i]).tanh() / a.max(1e-12)),
        Kind::SecondaryPulse => mapped(&|i| y[i] + a * (-0.5 * ((time(i) - p) / q).powi(2)).exp()),
        Kind::Flash => mapped(&|i| y[i] + a * (-time(i) / p).exp()),
        Kind::PulseHeating => mapped(&|i| y[i] + a * (1.0 - (-time(i) / p).exp())),
        Kind::LevelJump => mapped(&|i| y[i] + if time(i) >= p { a } else { 0.0 }),
        Kind::Resonance => {
            mapped(&|i| y[i] + a * (-q * p * time(i)).exp() * (p * time(i) + r).sin())
        }
        Kind::Crosstalk => mapped(&|i| y[i] + a * other[i]),
        Kind::LowPass => {
            // Exact for the straight line between neighbouring points of the fine grid.
            let (mut state, mut before) = (y[0], y[0]);
            let (tau, keep) = (a.max(1e-9), (-h / a.max(1e-9)).exp());
            y.iter()
                .map(|x| {
                    let rise = (x - before) * (1.0 - tau / h * (1.0 - keep));
                    state = keep * state + (1.0 - keep) * before + rise;
                    before = *x;
                    state
                })
                .collect()
        }
        Kind::Burst => mapped(&|i| {
            let u = (time(i) - p) / q;
            y[i] + if (0.0..=1.0).contains(&u) { a * (u * std::f64::consts::PI).sin() } else { 0.0 }
        }),
        Kind::Rectified => mapped(&|i| if y[i] < 0.0 { (1.0 - a) * y[i] } else { y[i] }),
        Kind::Drag | Kind::Cubic | Kind::Switching => y.to_vec(),
    }
}

/// Fine curves of a condition with all hidden effects.
pub fn curves(hidden: &[Hidden], truth: [f64; 4], condition: usize) -> Fine {
    let mut chain = Chain::plain(truth);
    for effect in hidden {
        match effect.kind {
            Kind::Drag => chain.drag += effect.size,
            Kind::Cubic => chain.cubic += effect.size,
            Kind::Switching => chain.switching += effect.size,
            _ => {}
        }
    }
    let mut curves = chain.curves(condition);
    for effect in hidden {
        let all = curves.clone();
        if effect.kind == Kind::Burst && condition as f64 != effect.shape[2] {
            continue;
        }
        for &s in &effect.sensors {
            let other = &all[(s + 1) % all.len()];
            let h = STEP / FINE as f64;
            curves[s] = distorted(effect.kind, effect.size, effect.shape, &all[s], other, h);
        }
    }
    curves
}
