//! Curves between their points: cubic splines on any increasing grid.

use lacuna::data::Layout;
use lacuna::plugin::effect::grid;

/// The factored equations of a cubic spline with continuous curvature through points on a grid.
///
/// The slopes at the ends are those of the cubic through the four points there (de Boor, A Practical Guide to
/// Splines (1978), chapter IV). The spline is linear in the values.
#[derive(Debug, Clone)]
pub struct Knots<'a> {
    /// The grid.
    pub at: &'a [f64],
    /// The inverse widths of the intervals.
    steps: Vec<f64>,
    /// The pivots of the elimination, one an inner point.
    pivots: Vec<f64>,
}

impl<'a> Knots<'a> {
    /// On the grid of a layout's curves.
    pub fn of(layout: &'a Layout) -> Self {
        Self::on(grid(layout))
    }

    /// On a grid.
    pub fn on(at: &'a [f64]) -> Self {
        let steps: Vec<f64> = at.windows(2).map(|w| 1.0 / (w[1] - w[0])).collect();
        let mut pivots: Vec<f64> = Vec::with_capacity(at.len());
        for w in steps.windows(2) {
            let (before, after) = (w[0], w[1]);
            let pivot = 2.0 * (before + after);
            pivots.push(pivots.last().map_or(pivot, |last| pivot - before * before / last));
        }
        Self { at, steps, pivots }
    }

    /// The slopes at the points of a curve.
    pub fn slopes(&self, values: &[f64]) -> Vec<f64> {
        let n = self.at.len();
        let mut slopes = vec![0.0; n];
        if n < 2 {
            return slopes;
        }
        slopes[0] = end_slope(self.at, values, |k| k);
        slopes[n - 1] = end_slope(self.at, values, |k| n - 1 - k);
        let step = |i: usize| self.steps[i];
        let rise = |i: usize| 3.0 * step(i) * step(i) * (values[i + 1] - values[i]);
        for i in 1..n - 1 {
            // The row before is eliminated from this one; the slopes at the ends are known.
            let carried = if i == 1 { slopes[0] } else { slopes[i - 1] / self.pivots[i - 2] };
            slopes[i] = rise(i - 1) + rise(i) - step(i - 1) * carried;
        }
        for i in (1..n - 1).rev() {
            slopes[i] = (slopes[i] - step(i) * slopes[i + 1]) / self.pivots[i - 1];
        }
        slopes
    }
}

/// The slope at the first of up to four points of the polynomial through them, from Newton's divided differences.
fn end_slope(at: &[f64], values: &[f64], place: impl Fn(usize) -> usize) -> f64 {
    let count = at.len().min(4);
    let x = |k: usize| at[place(k)];
    let mut differences = [0.0; 4];
    (0..count).for_each(|k| differences[k] = values[place(k)]);
    let (mut slope, mut product) = (0.0, 1.0);
    for order in 1..count {
        for k in 0..count - order {
            differences[k] = (differences[k + 1] - differences[k]) / (x(k + order) - x(k));
        }
        slope += product * differences[0];
        product *= x(0) - x(order);
    }
    slope
}

/// Calls `each` for every point of a curve with the spline's value and slope at an earlier time: at the point's
/// time less `by`, as [`shifted_by`] does.
pub fn shifted(
    knots: &Knots<'_>,
    values: &[f64],
    slopes: &[f64],
    by: f64,
    each: impl FnMut(usize, f64, f64),
) {
    shifted_by(knots, values, slopes, |_| by, each);
}

/// Calls `each` for every point of a curve with the spline's value and slope at another time: at the point's time less
/// `by` of it, which leaves the order of the points as it is. Before its first point and after its last a curve is at
/// rest.
pub fn shifted_by(
    knots: &Knots<'_>,
    values: &[f64],
    slopes: &[f64],
    by: impl Fn(f64) -> f64,
    each: impl FnMut(usize, f64, f64),
) {
    sampled(knots, values, slopes, |i| knots.at[i] - by(knots.at[i]), each);
}

/// Calls `each` for every point of a curve with the spline's value and slope at another time, that of the point's
/// index, which does not decrease. Before its first point and after its last a curve is at rest.
pub fn sampled(
    knots: &Knots<'_>,
    values: &[f64],
    slopes: &[f64],
    time: impl Fn(usize) -> f64,
    mut each: impl FnMut(usize, f64, f64),
) {
    let at = knots.at;
    let last = at.len() - 1;
    let mut k = 0;
    for i in 0..at.len() {
        let t = time(i);
        if last == 0 || t < at[0] {
            each(i, values[0], 0.0);
            continue;
        }
        if t >= at[last] {
            each(i, values[last], if t > at[last] { 0.0 } else { slopes[last] });
            continue;
        }
        while at[k + 1] <= t {
            k += 1;
        }
        let (h, rise) = (at[k + 1] - at[k], values[k + 1] - values[k]);
        let u = (t - at[k]) / h;
        let (a, b) = (slopes[k] * h, slopes[k + 1] * h);
        let (second, third) = (3.0 * rise - 2.0 * a - b, a + b - 2.0 * rise);
        let value = values[k] + u * (a + u * (second + u * third));
        each(i, value, (a + u * (2.0 * second + 3.0 * u * third)) / h);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{even, largest, uneven};
    use super::{Knots, shifted};

    fn moved(at: &[f64], by: f64, curve: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<f64>) {
        let values: Vec<f64> = at.iter().map(|t| curve(*t)).collect();
        let knots = Knots::on(at);
        let mut out = (vec![0.0; at.len()], vec![0.0; at.len()]);
        shifted(&knots, &values, &knots.slopes(&values), by, |i, value, slope| {
            (out.0[i], out.1[i]) = (value, slope);
        });
        out
    }

    /// A spline whose end slopes are those of a cubic is that cubic.
    #[test]
    fn a_cubic_is_its_own_spline() {
        let at = uneven(12, 0.5);
        let cubic = |t: f64| 1.0 - 2.0 * t + 0.3 * t * t - 0.1 * t * t * t;
        let (values, slopes) = moved(&at, 0.77, cubic);
        assert!(largest(&values, &at, 3..12, |t| cubic(t - 0.77)) < 1e-12);
        let slope = |t: f64| -2.0 + 0.6 * (t - 0.77) - 0.3 * (t - 0.77).powi(2);
        assert!(largest(&slopes, &at, 3..12, slope) < 1e-12);
        assert_eq!((values[0], slopes[0]), (cubic(at[0]), 0.0));
    }

    #[test]
    fn a_sine_of_eight_points_a_period_is_right_within_0_2_per_cent() {
        let sine = |t: f64| (std::f64::consts::TAU * t / 8.0).sin();
        let worst = |at: &[f64], by: f64| {
            let (values, _) = moved(at, by, sine);
            largest(&values, at, 8..56, |t| sine(t - by))
        };
        let even: Vec<f64> = (1..20).map(|k| worst(&even(64, 1.0), 0.1 * f64::from(k))).collect();
        assert!(even.iter().all(|error| *error < 2e-3), "{even:?}");
        let uneven = worst(&uneven(64, 1.0), 0.5);
        assert!(uneven < 1e-2, "{uneven}");
    }

    #[test]
    fn few_points_are_a_polynomial_or_at_rest() {
        assert_eq!(moved(&[1.0], 0.3, |t| t).0, [1.0]);
        assert!((moved(&[0.0, 2.0], 0.5, |t| 3.0 * t).0[1] - 4.5).abs() < 1e-15);
        assert!((moved(&[0.0, 1.0, 3.0], 0.5, |t| t * t).0[2] - 6.25).abs() < 1e-14);
    }
}
