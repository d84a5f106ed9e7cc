//! A distribution given by its quantiles at equally spaced normal scores.
//!
//! Between the scores the value is a monotone piecewise cubic function of the score (Fritsch and Butland, SIAM J. Sci. Stat.
//! Comput. 5 (1984) 300), beyond them it continues linearly, which gives normal tails. Where the support has bounds, the
//! function is that of an unbounded coordinate: the logarithm of the distance from the bound, or the logit.

use super::summary::over_scores;
use crate::math::special::HALF_LN_TWO_PI;

/// A distribution with these quantiles.
#[derive(Clone, Copy)]
pub(super) struct Quantiles<'a> {
    low: f64,
    high: f64,
    reach: f64,
    values: &'a [f64],
}

/// Fewest quantiles of a distribution.
const FEWEST: usize = 3;

impl<'a> Quantiles<'a> {
    /// The distribution of numbers that were checked: bounds, largest score, quantiles.
    pub(super) fn of(numbers: &'a [f64]) -> Self {
        Self { low: numbers[0], high: numbers[1], reach: numbers[2], values: &numbers[3..] }
    }

    /// Description of valid numbers, if these are not.
    pub(super) fn wrong(numbers: &[f64]) -> Option<&'static str> {
        if numbers.len() < 3 + FEWEST {
            return Some("two bounds, the largest score, and at least three quantiles");
        }
        let q = Quantiles::of(numbers);
        let increasing = q.values.windows(2).all(|pair| pair[0] < pair[1]);
        let inside = q.low < q.values[0] && q.values[q.values.len() - 1] < q.high;
        if !(q.reach > 0.0 && q.reach.is_finite()) {
            Some("a largest score above zero")
        } else if !(increasing && inside && q.values.iter().all(|x| x.is_finite())) {
            Some("increasing quantiles inside the bounds")
        } else {
            None
        }
    }

    pub(super) fn support(self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// The unbounded coordinate of a value, and its derivative and that of the derivative's logarithm.
    fn coordinate(self, x: f64) -> (f64, f64, f64) {
        let (a, b) = (x - self.low, self.high - x);
        match (a.is_finite(), b.is_finite()) {
            (true, true) => (a.ln() - b.ln(), 1.0 / a + 1.0 / b, 1.0 / b - 1.0 / a),
            (true, false) => (a.ln(), 1.0 / a, -1.0 / a),
            (false, true) => (-b.ln(), 1.0 / b, 1.0 / b),
            (false, false) => (x, 1.0, 0.0),
        }
    }

    fn value_of(self, y: f64) -> f64 {
        match (self.low.is_finite(), self.high.is_finite()) {
            (true, true) => {
                let (small, width) = ((-y.abs()).exp(), self.high - self.low);
                let share = width * small / (1.0 + small);
                if y < 0.0 { self.low + share } else { self.high - share }
            }
            (true, false) => self.low + y.exp(),
            (false, true) => self.high - (-y).exp(),
            (false, false) => y,
        }
    }

    fn step(self) -> f64 {
        2.0 * self.reach / (self.values.len() - 1) as f64
    }

    fn knot(self, k: usize) -> f64 {
        self.coordinate(self.values[k]).0
    }

    /// Slope between two neighbouring quantiles.
    fn secant(self, k: usize) -> f64 {
        (self.knot(k + 1) - self.knot(k)) / self.step()
    }

    /// Slope at a quantile.
    fn slope(self, k: usize) -> f64 {
        let last = self.values.len() - 1;
        if k == 0 {
            return self.secant(0);
        }
        if k == last {
            return self.secant(last - 1);
        }
        let (a, b) = (self.secant(k - 1), self.secant(k));
        2.0 * a * b / (a + b)
    }

    /// The cubic between quantiles `k` and `k + 1`: value and two derivatives at a share `t` of the interval.
    fn cubic(self, k: usize, t: f64) -> [f64; 3] {
        let h = self.step();
        let (a, b) = (self.knot(k), self.knot(k + 1));
        let (c, d) = (h * self.slope(k), h * self.slope(k + 1));
        let (p, q) = (3.0 * (b - a) - 2.0 * c - d, 2.0 * (a - b) + c + d);
        [
            a + t * (c + t * (p + t * q)),
            (c + t * (2.0 * p + 3.0 * t * q)) / h,
            (2.0 * p + 6.0 * t * q) / (h * h),
        ]
    }

    /// The coordinate at a score, with two derivatives.
    fn at(self, z: f64) -> [f64; 3] {
        let last = self.values.len() - 1;
        if z <= -self.reach {
            let slope = self.slope(0);
            return [self.knot(0) + slope * (z + self.reach), slope, 0.0];
        }
        if z >= self.reach {
            let slope = self.slope(last);
            return [self.knot(last) + slope * (z - self.reach), slope, 0.0];
        }
        let place = (z + self.reach) / self.step();
        let k = (place as usize).min(last - 1);
        self.cubic(k, place - k as f64)
    }

    /// The value at a score.
    pub(super) fn at_score(self, z: f64) -> f64 {
        self.value_of(self.at(z)[0])
    }

    /// The score of a value inside the support.
    pub(super) fn score(self, x: f64) -> f64 {
        let (y, ..) = self.coordinate(x);
        let last = self.values.len() - 1;
        if x <= self.values[0] {
            return (y - self.knot(0)) / self.slope(0) - self.reach;
        }
        if x >= self.values[last] {
            return (y - self.knot(last)) / self.slope(last) + self.reach;
        }
        let k = self.values.partition_point(|&value| value <= x) - 1;
        let (mut low, mut high, mut t) = (0.0, 1.0, 0.5);
        // Newton's steps inside a bracket, which halves where a step would leave it.
        for _ in 0..60 {
            let [value, slope, _] = self.cubic(k, t);
            if value < y {
                low = t;
            } else {
                high = t;
            }
            let newton = t - (value - y) / (slope * self.step());
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - t).abs() < 1e-15 {
                break;
            }
            t = next;
        }
        (k as f64 + t) * self.step() - self.reach
    }

    pub(super) fn log_density(self, x: f64) -> f64 {
        let z = self.score(x);
        let (_, by_x, _) = self.coordinate(x);
        -0.5 * z * z - HALF_LN_TWO_PI - self.at(z)[1].ln() + by_x.ln()
    }

    pub(super) fn log_density_derivative(self, x: f64) -> f64 {
        let z = self.score(x);
        let [_, slope, bend] = self.at(z);
        let (_, by_x, of_log) = self.coordinate(x);
        (-z - bend / slope) / slope * by_x + of_log
    }

    pub(super) fn mean(self) -> f64 {
        over_scores(|z| self.at_score(z))
    }

    pub(super) fn variance(self) -> f64 {
        let mean = self.mean();
        over_scores(|z| (self.at_score(z) - mean).powi(2))
    }

    /// The value of the largest density among 2001 equally spaced scores.
    pub(super) fn mode(self) -> f64 {
        let score = |i: i32| f64::from(i) / 1000.0 * (self.reach + 1.0);
        let all = (-1000..=1000).map(|i| self.at_score(score(i)));
        let inside = all.filter(|&x| x > self.low && x < self.high);
        let density = |x: f64| self.log_density(x);
        inside.max_by(|&a, &b| density(a).total_cmp(&density(b))).unwrap_or(self.values[0])
    }
}

#[cfg(test)]
mod tests;
