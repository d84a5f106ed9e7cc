//! Lines `value - distance * rate` and a level that falls at rate 1, approaching them from above for positive values
//! and from below (as its negative) for negative values: kernels on slices as in [`vector`](crate::vector).

#![allow(clippy::inline_always)]

use pulp::{Arch, Simd, WithSimd};

const LANES: usize = 8;

/// Lines, given as arrays of equal length.
#[derive(Debug, Clone, Copy)]
pub struct Lines<'a> {
    /// Value of each line at distance zero.
    pub values: &'a [f64],
    /// Rate at which each line falls.
    pub rates: &'a [f64],
    /// Added to the distance of each line: zero, or infinity for lines that must not be met.
    pub closed: &'a [f64],
}

impl Lines<'_> {
    fn check(&self, scratch: &[f64]) {
        let lengths = [self.values.len(), self.rates.len(), self.closed.len()];
        assert_eq!(lengths, [scratch.len(); 3], "vectors of one length");
    }
}

/// The line that the level, or its negative, meets first, and the distance to it. `scratch` has one entry per line.
///
/// A line that the level does not approach is never met; one that equals the level up to round-off is met at once.
///
/// # Panics
/// If the lengths differ.
pub fn first_meeting(level: f64, lines: Lines<'_>, scratch: &mut [f64]) -> Option<(usize, f64)> {
    lines.check(scratch);
    Arch::new().dispatch(FirstMeeting { level, lines, scratch })
}

struct FirstMeeting<'a> {
    level: f64,
    lines: Lines<'a>,
    scratch: &'a mut [f64],
}

#[inline(always)]
fn meeting(level: f64, value: f64, rate: f64, closed: f64) -> f64 {
    let up = closing(level - value, 1.0 - rate);
    let down = closing(level + value, 1.0 + rate);
    closed + if up < down { up } else { down }
}

/// Distance at which a gap closes; infinite if `gain`, the rate at which it shrinks, is not positive.
#[inline(always)]
fn closing(gap: f64, gain: f64) -> f64 {
    let distance = (if gap > 0.0 { gap } else { 0.0 }) / gain;
    if gain > 1e-12 { distance } else { f64::INFINITY }
}

#[inline(always)]
fn holds(lanes: &[f64; LANES], value: f64) -> bool {
    let mut any = false;
    for lane in lanes {
        any |= *lane == value;
    }
    any
}

impl WithSimd for FirstMeeting<'_> {
    type Output = Option<(usize, f64)>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Option<(usize, f64)> {
        let Lines { values, rates, closed } = self.lines;
        let ((v, rest_v), (r, rest_r)) = (values.as_chunks::<LANES>(), rates.as_chunks::<LANES>());
        let (c, rest_c) = closed.as_chunks::<LANES>();
        let (s, rest_s) = self.scratch.as_chunks_mut::<LANES>();
        let mut lanes = [f64::INFINITY; LANES];
        for (((s, v), r), c) in s.iter_mut().zip(v).zip(r).zip(c) {
            for l in 0..LANES {
                s[l] = meeting(self.level, v[l], r[l], c[l]);
                lanes[l] = if s[l] < lanes[l] { s[l] } else { lanes[l] };
            }
        }
        for (((s, v), r), c) in rest_s.iter_mut().zip(rest_v).zip(rest_r).zip(rest_c) {
            *s = meeting(self.level, *v, *r, *c);
            lanes[0] = if *s < lanes[0] { *s } else { lanes[0] };
        }
        let mut least = f64::INFINITY;
        for lane in lanes {
            least = if lane < least { lane } else { least };
        }
        let mut whole = 0;
        // The minimum is found without its index, which would prevent vectorisation; a second pass locates it.
        while whole < s.len() && !holds(&s[whole], least) {
            whole += 1;
        }
        let begin = whole * LANES;
        let first = self.scratch[begin..].iter().position(|&a| a == least)?;
        (least < f64::INFINITY).then_some((begin + first, least))
    }
}

/// Writes to `gaps` the smallest gap between each line and the level while the level falls by `distance`.
///
/// A gap is a concave function of the distance, so its minimum is at one of the ends.
///
/// # Panics
/// If the lengths differ.
pub fn least_gaps(level: f64, distance: f64, lines: Lines<'_>, gaps: &mut [f64]) {
    lines.check(gaps);
    Arch::new().dispatch(LeastGaps { level, distance, lines, gaps });
}

struct LeastGaps<'a> {
    level: f64,
    distance: f64,
    lines: Lines<'a>,
    gaps: &'a mut [f64],
}

impl WithSimd for LeastGaps<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { level, distance, lines: Lines { values, rates, closed }, gaps } = self;
        for (((gap, v), rate), closed) in gaps.iter_mut().zip(values).zip(rates).zip(closed) {
            let begin = level - v.abs();
            let end = level - distance - (v - distance * rate).abs();
            *gap = closed + if begin < end { begin } else { end };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deterministic lines of both signs, every fifth one closed.
    fn lines(n: usize) -> [Vec<f64>; 3] {
        let closed = |i: usize| if i % 5 == 3 { f64::INFINITY } else { 0.0 };
        [
            (0..n).map(|i| 0.9 * (1.7 * i as f64 + 0.3).sin()).collect(),
            (0..n).map(|i| 1.2 * (0.9 * i as f64 + 0.1).cos()).collect(),
            (0..n).map(closed).collect(),
        ]
    }

    #[test]
    fn the_first_meeting_is_on_the_level_and_no_line_is_met_before() {
        for n in [1, 3, 8, 17, 64, 100] {
            let [values, rates, closed] = lines(n);
            let all = Lines { values: &values, rates: &rates, closed: &closed };
            let mut scratch = vec![0.0; n];
            let (first, distance) = first_meeting(1.0, all, &mut scratch).unwrap();
            let gap = |i: usize, d: f64| (1.0 - d) - (values[i] - d * rates[i]).abs();
            assert!(gap(first, distance).abs() < 1e-13);
            for i in (0..n).filter(|i| closed[*i] == 0.0) {
                assert!(gap(i, 0.999 * distance) > 0.0, "{n} {i}");
            }
            let mut gaps = vec![0.0; n];
            least_gaps(1.0, distance, all, &mut gaps);
            for i in 0..n {
                let plain = gap(i, 0.0).min(gap(i, distance)) + closed[i];
                assert!(gaps[i] == plain || (gaps[i] - plain).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn lines_that_are_closed_or_keep_ahead_are_not_met() {
        let values = [0.5, 0.2, 1.0];
        let closed = [f64::INFINITY, 0.0, 0.0];
        let all = Lines { values: &values, rates: &[0.0, -3.0, 1.0], closed: &closed };
        assert_eq!(first_meeting(1.0, all, &mut [0.0; 3]), Some((1, 0.8 / 4.0)));
        let none = Lines { values: &values[..1], rates: &[0.0], closed: &closed[..1] };
        assert_eq!(first_meeting(1.0, none, &mut [0.0]), None);
    }
}
