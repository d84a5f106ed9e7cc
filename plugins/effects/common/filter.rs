//! A first-order lag on curves.

use lacuna::data::Layout;
use lacuna::plugin::effect::each_curve;

use super::Knots;

/// The lag `T z' = y - z` between the points of a grid, exactly for an input that is a cubic between two points.
///
/// Over a step `h` with `a = h / T` and an input `c0 + c1 s + c2 s^2 + c3 s^3` the output goes from `z` to
/// `exp(-a) z + sum of c_j h^j m_j`, where `m_j = a * integral of exp(-a (1 - u)) u^j over 0 <= u <= 1`. Integration
/// by parts gives `m_j = 1 - j m_(j-1) / a`.
#[derive(Debug, Clone)]
pub struct Filter {
    steps: Vec<Step>,
}

/// One step between two points.
#[derive(Debug, Clone, Copy)]
struct Step {
    length: f64,
    decay: f64,
    moments: [f64; 4],
    /// The derivatives by the time constant.
    decay_slope: f64,
    moment_slopes: [f64; 4],
}

impl Filter {
    /// On a grid; `None` for a time constant so small that there is no lag.
    pub fn new(at: &[f64], time_constant: f64) -> Option<Self> {
        if time_constant < 1e-100 {
            return None;
        }
        let mut steps: Vec<Step> = Vec::with_capacity(at.len());
        for w in at.windows(2) {
            let length = w[1] - w[0];
            match steps.last() {
                // Steps of a uniform grid differ by rounding only.
                Some(last) if (last.length - length).abs() <= 1e-12 * length => steps.push(*last),
                _ => steps.push(Step::new(length, time_constant)),
            }
        }
        Some(Self { steps })
    }

    /// The derivatives of a filtered response by the time constant.
    pub fn slopes(
        layout: &Layout,
        time_constant: f64,
        response: &[f64],
        filtered: &[f64],
    ) -> Vec<f64> {
        let knots = Knots::of(layout);
        let filter = Self::new(knots.at, time_constant);
        let mut outputs = filtered.chunks(knots.at.len());
        each_curve(layout, response, |y, out| match (&filter, outputs.next()) {
            (Some(filter), Some(output)) => filter.slope(&knots, y, output, out),
            _ => {
                // Without a lag the output falls behind by the constant, but for its first value.
                out.iter_mut().zip(knots.slopes(y)).skip(1).for_each(|(out, s)| *out = -s);
            }
        })
    }

    /// The output for a curve, from rest at its first value.
    pub fn answer(&self, knots: &Knots<'_>, values: &[f64], out: &mut [f64]) {
        let slopes = knots.slopes(values);
        out[0] = values[0];
        for (i, step) in self.steps.iter().enumerate() {
            let cubic = step.cubic(&values[i..], &slopes[i..]);
            out[i + 1] = step.decay * out[i] + dot(&cubic, &step.moments);
        }
    }

    /// The derivative of the output by the time constant, given the output.
    fn slope(&self, knots: &Knots<'_>, values: &[f64], output: &[f64], out: &mut [f64]) {
        let slopes = knots.slopes(values);
        out[0] = 0.0;
        for (i, step) in self.steps.iter().enumerate() {
            let cubic = step.cubic(&values[i..], &slopes[i..]);
            let forced = step.decay_slope * output[i] + dot(&cubic, &step.moment_slopes);
            out[i + 1] = step.decay * out[i] + forced;
        }
    }
}

impl Step {
    fn new(length: f64, time_constant: f64) -> Self {
        let a = length / time_constant;
        let by_constant = -a / time_constant;
        let (moments, slopes) = moments(a);
        let decay = (-a).exp();
        Self {
            length,
            decay,
            moments,
            decay_slope: -decay * by_constant,
            moment_slopes: slopes.map(|slope| slope * by_constant),
        }
    }

    /// The coefficients `c_j h^j` of the input.
    fn cubic(&self, values: &[f64], slopes: &[f64]) -> [f64; 4] {
        let rise = values[1] - values[0];
        let (a, b) = (slopes[0] * self.length, slopes[1] * self.length);
        [values[0], a, 3.0 * rise - 2.0 * a - b, a + b - 2.0 * rise]
    }
}

fn dot(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The moments `m_0` to `m_3` and their derivatives by `a`.
fn moments(a: f64) -> ([f64; 4], [f64; 4]) {
    let mut m = [0.0; 5];
    let mut slopes = [0.0; 4];
    if a > 1.0 {
        m[0] = -(-a).exp_m1();
        slopes[0] = (-a).exp();
        for j in 1..4 {
            let ratio = j as f64 / a;
            m[j] = 1.0 - ratio * m[j - 1];
            slopes[j] = ratio / a * m[j - 1] - ratio * slopes[j - 1];
        }
    } else {
        // The series of m_4, then the recursion backwards, which loses no digits here.
        let mut term = a / 5.0;
        for k in 1..24 {
            m[4] += term;
            term *= -a / f64::from(5 + k);
        }
        for j in (0..4).rev() {
            m[j] = a / (j + 1) as f64 * (1.0 - m[j + 1]);
        }
        // m_j / a = (1 - m_(j+1)) / (j + 1), without a division by a small number.
        (0..4).for_each(|j| slopes[j] = (1.0 - m[j + 1]) / (j + 1) as f64 - m[j] + m[j + 1]);
    }
    ([m[0], m[1], m[2], m[3]], slopes)
}
