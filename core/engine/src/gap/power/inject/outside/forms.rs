//! Listed physics in another form: other powers, other laws of decay, hard limits, filters of higher order.

use lacuna::math::random::uniform;
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::record::Record;
use super::{Curves, Drawn};

/// Physics like that of the library, in another form.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OtherForm {
    /// A loss at a rate that is a power of the amplitude, as of drag.
    Drag,
    /// A loss by a stretched or a compressed exponential.
    StretchedExponential,
    /// A hard limit on one side.
    OneSidedClip,
    /// Nothing below a threshold, the excess above it.
    DeadZone,
    /// A low-pass filter of second order.
    SecondOrder,
    /// A delay that is longer for slow changes than for fast ones: an all-pass filter.
    DispersiveDelay,
}

/// A number between these.
fn between(rng: &mut impl Rng, [low, high]: [f64; 2]) -> f64 {
    low + (high - low) * uniform(rng)
}

/// A number in either of these ranges.
fn outside_of(rng: &mut impl Rng, below: [f64; 2], above: [f64; 2]) -> f64 {
    if uniform(rng) < 0.5 { between(rng, below) } else { between(rng, above) }
}

impl OtherForm {
    /// All forms.
    pub const ALL: [Self; 6] = [
        Self::Drag,
        Self::StretchedExponential,
        Self::OneSidedClip,
        Self::DeadZone,
        Self::SecondOrder,
        Self::DispersiveDelay,
    ];

    /// The form with random parameters on random curves.
    pub(super) fn drawn(self, curves: &Curves<'_>, rng: &mut impl Rng) -> Drawn {
        let acts = curves.some(rng);
        match self {
            Self::Drag => {
                let power = outside_of(rng, [0.3, 0.8], [1.3, 2.0]);
                let form = format!("a loss at a rate of the amplitude to the power {power:.2}");
                Drawn::of(form, acts, move |record, size| {
                    let lost = record.summed(|y| y.abs().powf(power));
                    let kept = |i: f64| (1.0 + size * power * i).powf(-1.0 / power);
                    record.y.iter().zip(lost).map(|(y, i)| y * kept(i)).collect()
                })
            }
            Self::StretchedExponential => {
                let power = outside_of(rng, [0.4, 0.7], [1.5, 2.2]);
                let form = format!("a loss by an exponential of time to the power {power:.2}");
                Drawn::of(form, acts, move |record, size| {
                    let kept = |t: &f64| (-size * t.powf(power)).exp();
                    record.y.iter().zip(&record.at).map(|(y, t)| y * kept(t)).collect()
                })
            }
            Self::OneSidedClip => {
                let sign = if uniform(rng) < 0.5 { 1.0 } else { -1.0 };
                let form = "a hard limit on one side".to_owned();
                Drawn::of(form, acts, move |record, size| clipped(record, sign, size))
            }
            Self::DeadZone => {
                let form = "nothing below a threshold".to_owned();
                Drawn::of(form, acts, |record, size| {
                    let threshold = size / (1.0 + size);
                    let beyond = |y: &f64| y.signum() * (y.abs() - threshold).max(0.0);
                    record.y.iter().map(beyond).collect()
                })
            }
            Self::SecondOrder => {
                let ratio = between(rng, [0.2, 0.9]);
                let form = format!("a low-pass filter of second order, damping ratio {ratio:.2}");
                Drawn::of(form, acts, move |record, size| second_order(record, size, ratio))
            }
            Self::DispersiveDelay => {
                let form = "a delay that falls with the frequency".to_owned();
                Drawn::of(form, acts, |record, size| {
                    let slow = first_order(record, size);
                    record.y.iter().zip(slow).map(|(y, x)| 2.0 * x - y).collect()
                })
            }
        }
    }
}

/// The values limited on the side of `sign`, the lower the larger the size.
fn clipped(record: &Record, sign: f64, size: f64) -> Vec<f64> {
    let top = record.y.iter().map(|y| sign * y).fold(0.0, f64::max);
    let limit = top / (1.0 + size);
    record.y.iter().map(|y| sign * (sign * y).min(limit)).collect()
}

/// A low-pass filter of first order and this time constant, in lengths of the curve: exact for an input that is linear
/// between the values.
fn first_order(record: &Record, constant: f64) -> Vec<f64> {
    let mut x = record.y[0];
    let mut all = vec![x];
    for (t, y) in record.at.windows(2).zip(record.y.windows(2)) {
        let run = t[1] - t[0];
        if run > 0.0 {
            let lag = constant * (y[1] - y[0]) / run;
            x = y[1] - lag + (x - y[0] + lag) * (-run / constant).exp();
        }
        all.push(x);
    }
    all
}

/// The largest number of steps of the integration between two values.
const STEPS: f64 = 200.0;

/// A low-pass filter of second order with this time constant, in lengths of the curve: `c^2 x'' + 2 ratio c x' + x = y`,
/// at rest in the beginning, by the classical method of Runge and Kutta. A filter that is faster than a fortieth of the
/// distance between two values changes nothing.
fn second_order(record: &Record, constant: f64, ratio: f64) -> Vec<f64> {
    let (mut x, mut v) = (record.y[0], 0.0);
    let mut all = vec![x];
    for (t, y) in record.at.windows(2).zip(record.y.windows(2)) {
        let run = t[1] - t[0];
        let steps = (run / (0.2 * constant)).ceil().max(1.0);
        if steps > STEPS || run <= 0.0 {
            (x, v) = (y[1], 0.0);
            all.push(x);
            continue;
        }
        let h = run / steps;
        for k in 0..steps as usize {
            let input = |c: f64| y[0] + (y[1] - y[0]) * (k as f64 + c) / steps;
            let rate = |x: f64, v: f64, c: f64| {
                (v, ((input(c) - x) / constant - 2.0 * ratio * v) / constant)
            };
            let a = rate(x, v, 0.0);
            let b = rate(x + 0.5 * h * a.0, v + 0.5 * h * a.1, 0.5);
            let c = rate(x + 0.5 * h * b.0, v + 0.5 * h * b.1, 0.5);
            let d = rate(x + h * c.0, v + h * c.1, 1.0);
            x += h / 6.0 * (a.0 + 2.0 * b.0 + 2.0 * c.0 + d.0);
            v += h / 6.0 * (a.1 + 2.0 * b.1 + 2.0 * c.1 + d.1);
        }
        all.push(x);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(y: impl Fn(f64) -> f64) -> Record {
        let at: Vec<f64> = (0..=200).map(|i| f64::from(i) / 200.0).collect();
        Record { y: at.iter().map(|t| y(*t)).collect(), at, scale: 1.0, place: 0.0 }
    }

    /// The answer of a filter of first order to the ramp `t` is `t - c + c exp(-t / c)`; that of an underdamped filter of
    /// second order to a step from rest is `1 - exp(-z w t) (cos(d t) + z / sqrt(1 - z^2) sin(d t))`, `d = w sqrt(1 - z^2)`
    /// (Ogata, Modern Control Engineering, section 5.3).
    #[test]
    fn filters_have_their_closed_forms() {
        let ramp = record(|t| t);
        for (x, t) in first_order(&ramp, 0.1).iter().zip(&ramp.at) {
            let exact = t - 0.1 + 0.1 * (-t / 0.1).exp();
            assert!((x - exact).abs() < 1e-12, "{t}: {x} {exact}");
        }
        // The step is between the first two values, on which the input rises linearly.
        let step = record(|t| if t > 0.0 { 1.0 } else { 0.0 });
        let (constant, ratio) = (0.05, 0.3);
        let damped = f64::sqrt(1.0 - ratio * ratio);
        for (x, t) in second_order(&step, constant, ratio).iter().zip(&step.at).skip(1) {
            let w = (t - 0.0025) / constant;
            let wave = (damped * w).cos() + ratio / damped * (damped * w).sin();
            let exact = 1.0 - (-ratio * w).exp() * wave;
            // A ramp of duration h in place of a step in its middle: an error of about (h / c)^2 / 24 = 4e-4.
            assert!((x - exact).abs() < 1.5e-3, "{t}: {x} {exact}");
        }
    }
}
