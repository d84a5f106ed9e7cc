//! Low-pass filter of a record that is resampled to wider spaced times.

use std::f64::consts::PI;

/// Attenuation in decibels: the gain differs from one by at most 10^(-66/20) = 0.0005 where it should be one, and from
/// zero by as much where it should be zero. Between samples the images of a record at its own rate add as much.
const ATTENUATION: f64 = 66.0;
/// End of the frequencies that pass, and start of those that are stopped, as fractions of the lower Nyquist frequency.
const PASSED: f64 = 0.8;
const STOPPED: f64 = 1.0;

/// A sinc function under a Kaiser window, of unit gain at frequency zero.
///
/// Source: Kaiser, Proc. IEEE ISCAS (1974) 20, as in Oppenheim and Schafer, *Discrete-Time Signal Processing*, section
/// 7.5.3: beta = 0.1102 (A - 8.7) and M = (A - 7.95) / (2.285 width), the width in radians a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LowPass {
    /// Cut-off in cycles per unit of time.
    cutoff: f64,
    beta: f64,
    /// Half of the length of the filter, in units of time.
    pub half: f64,
}

impl LowPass {
    /// A filter for records with the sample interval `step` that are resampled to the interval `spacing`.
    pub fn new(step: f64, spacing: f64) -> Self {
        let nyquist = 0.5 / step.max(spacing);
        let width = 2.0 * PI * (STOPPED - PASSED) * nyquist;
        Self {
            cutoff: 0.5 * (PASSED + STOPPED) * nyquist,
            beta: 0.1102 * (ATTENUATION - 8.7),
            half: 0.5 * (ATTENUATION - 7.95) / (2.285 * width),
        }
    }

    fn weight(&self, lag: f64) -> f64 {
        let x = 2.0 * PI * self.cutoff * lag;
        let sinc = if x == 0.0 { 1.0 } else { x.sin() / x };
        let inside = (1.0 - (lag / self.half).powi(2)).max(0.0).sqrt();
        sinc * bessel(self.beta * inside)
    }

    /// The filtered record at a time; `first` is the time of its first sample. Beyond its ends the record is continued by
    /// its point reflection there, which keeps straight lines. `None` if a sample within the filter is missing, or the
    /// time is outside the record.
    pub fn at(&self, time: f64, first: f64, step: f64, values: &[f64]) -> Option<f64> {
        let last = values.len().checked_sub(1)? as i64;
        let position = (time - first) / step;
        // The ends of a record count as inside up to the rounding of its times.
        if !(-1e-6..=last as f64 + 1e-6).contains(&position) {
            return None;
        }
        let reach = self.half / step;
        let (mut sum, mut weights) = (0.0, 0.0);
        for n in (position - reach).ceil() as i64..=(position + reach).floor() as i64 {
            let value = |i: i64| values.get(usize::try_from(i).ok()?).copied();
            let sample = if n < 0 {
                2.0 * value(0)? - value(-n)?
            } else if n > last {
                2.0 * value(last)? - value(2 * last - n)?
            } else {
                value(n)?
            };
            let weight = self.weight((n as f64 - position) * step);
            sum += weight * sample;
            weights += weight;
        }
        Some(sum / weights).filter(|y| !y.is_nan())
    }
}

/// Modified Bessel function of the first kind and order zero, by its power series.
fn bessel(x: f64) -> f64 {
    let quarter = 0.25 * x * x;
    let (mut sum, mut term, mut k) = (1.0, 1.0, 1.0);
    while term > f64::EPSILON * sum {
        term *= quarter / (k * k);
        sum += term;
        k += 1.0;
    }
    sum
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::{LowPass, bessel};

    /// Filtered sines against the sine itself below 0.8 of the lower Nyquist frequency, and against zero above it.
    #[test]
    fn sines_pass_below_the_limit_and_vanish_above() {
        for (step, spacing) in [(0.1, 1.0), (0.37, 1.0), (1.0, 1.0), (1.0, 0.4)] {
            let count = (400.0 / step) as usize;
            let low_pass = LowPass::new(step, spacing);
            let nyquist = 0.5 / step.max(spacing);
            for part in [0.0, 0.1, 0.5, 0.8, 1.0, 1.3, 2.0, 4.2] {
                // A record holds no frequency above its own Nyquist frequency.
                if part * nyquist >= 0.5 / step {
                    continue;
                }
                let sine = |t: f64| (2.0 * PI * part * nyquist * t + 0.4).sin();
                let values: Vec<f64> = (0..count).map(|n| sine(n as f64 * step)).collect();
                for k in 0..40 {
                    let time = 150.0 + f64::from(k) * spacing * 1.03;
                    let found = low_pass.at(time, 0.0, step, &values).unwrap_or(f64::NAN);
                    let right = if part < 0.9 { sine(time) } else { 0.0 };
                    let error = (found - right).abs();
                    assert!(error <= 1e-3, "step {step}, {part} of Nyquist, {time}: {error}");
                }
            }
        }
    }

    #[test]
    fn a_straight_line_is_kept_to_its_ends() {
        let values: Vec<f64> = (0..500).map(|n| 3.0 - 0.25 * f64::from(n)).collect();
        let low_pass = LowPass::new(0.1, 1.0);
        for time in [2.0, 2.05, 10.0, 51.83, 51.9] {
            let found = low_pass.at(time, 2.0, 0.1, &values).unwrap_or(f64::NAN);
            let right = 3.0 - 2.5 * (time - 2.0);
            // At samples the filter is symmetric; between them it has its error, of the change in an interval.
            let bound = if time == 51.83 || time == 2.05 { 1e-3 * 2.5 } else { 1e-9 };
            assert!((found - right).abs() < bound, "{time}: {found} {right}");
        }
        assert_eq!(low_pass.at(1.9, 2.0, 0.1, &values), None);
        assert_eq!(low_pass.at(52.0, 2.0, 0.1, &values), None);
    }

    #[test]
    fn a_missing_sample_makes_the_values_around_it_missing() {
        let mut values = vec![1.0; 900];
        values[450] = f64::NAN;
        let low_pass = LowPass::new(0.1, 1.0);
        assert_eq!(low_pass.at(45.0 + low_pass.half - 0.05, 0.0, 0.1, &values), None);
        assert_eq!(low_pass.at(45.0 + low_pass.half + 0.05, 0.0, 0.1, &values), Some(1.0));
    }

    /// Abramowitz and Stegun, table 9.8: exp(-x) I0(x) at 1, 2 and 5.
    #[test]
    fn the_bessel_function_has_its_tabulated_values() {
        for (x, right) in
            [(1.0, 0.465_759_607_7_f64), (2.0, 0.308_508_322_5), (5.0, 0.183_540_812_6)]
        {
            let found = bessel(x) * f64::exp(-x);
            assert!((found - right).abs() < 1e-9, "{x}: {found}");
        }
    }
}
