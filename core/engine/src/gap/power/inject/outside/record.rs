//! Curves as the changes of other form see them: values in units of their own size, at shares of their length.

use crate::gap::experiment::MeasuredCurve;

/// The measured values of a curve.
pub struct Record {
    /// The values over [`Record::scale`].
    pub y: Vec<f64>,
    /// The places along the curve, from 0 at the first to 1 at the last.
    pub at: Vec<f64>,
    /// The largest absolute value, in the response's unit.
    pub scale: f64,
    /// The place of the sensor among all, from 0 to 1.
    pub place: f64,
}

impl Record {
    /// The record of a curve with this response, whose sensor is at `place`.
    pub fn of(curve: &MeasuredCurve, response: &[f64], place: f64) -> Self {
        let values: Vec<f64> = curve.measured.iter().map(|&i| response[i]).collect();
        let largest = values.iter().fold(0.0, |most: f64, y| most.max(y.abs()));
        let scale = if largest > 0.0 { largest } else { 1.0 };
        let y = values.iter().map(|y| y / scale).collect();
        let (first, last) = (curve.at.first().copied(), curve.at.last().copied());
        let (first, last) = (first.unwrap_or(0.0), last.unwrap_or(1.0));
        let length = if last > first { last - first } else { 1.0 };
        let at = curve.at.iter().map(|t| (t - first) / length).collect();
        Self { y, at, scale, place }
    }

    /// The number of values.
    pub fn len(&self) -> usize {
        self.y.len()
    }

    /// The derivative along the curve, over its largest absolute value.
    pub fn slope(&self) -> Vec<f64> {
        let n = self.len();
        let of = |k: usize| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(n - 1));
            let run = self.at[b] - self.at[a];
            if run > 0.0 { (self.y[b] - self.y[a]) / run } else { 0.0 }
        };
        normed((0..n).map(of).collect())
    }

    /// The integral from the beginning by the trapezoidal rule, over its largest absolute value.
    pub fn integral(&self) -> Vec<f64> {
        normed(self.summed(|y| y))
    }

    /// The integral from the beginning of a function of the values.
    pub fn summed(&self, f: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut sum = 0.0;
        let step = |k: usize| {
            if k > 0 {
                let run = self.at[k] - self.at[k - 1];
                sum += 0.5 * run * (f(self.y[k]) + f(self.y[k - 1]));
            }
            sum
        };
        (0..self.len()).map(step).collect()
    }

    /// The values `lag` earlier, by linear interpolation; the first value before the beginning.
    pub fn earlier(&self, lag: f64) -> Vec<f64> {
        self.at.iter().map(|t| self.value(t - lag)).collect()
    }

    fn value(&self, t: f64) -> f64 {
        let next = self.at.partition_point(|other| *other < t);
        if next == 0 {
            return self.y[0];
        }
        if next == self.len() {
            return self.y[next - 1];
        }
        let (a, b) = (self.at[next - 1], self.at[next]);
        let share = if b > a { (t - a) / (b - a) } else { 0.0 };
        self.y[next - 1] + share * (self.y[next] - self.y[next - 1])
    }
}

/// Values over their largest absolute value.
pub fn normed(mut values: Vec<f64>) -> Vec<f64> {
    let largest = values.iter().fold(0.0, |most: f64, y| most.max(y.abs()));
    if largest > 0.0 {
        for y in &mut values {
            *y /= largest;
        }
    }
    values
}
