//! Variance-based sensitivity of values to random inputs: Sobol indices and Shapley effects with standard errors.
//!
//! One sample is a draw `a` of the inputs and points that share some inputs with it, the others being drawn anew given
//! the shared ones ([`Inputs::redraw`]). With `f_u` the value where the inputs `u` are drawn anew:
//!
//! - **Total index** of input `i`: `E (f_∅ - f_i)² / 2 V` (Jansen, Computer Physics Communications 117 (1999) 35), which
//!   is the expected variance that is left when all other inputs are known.
//! - **First-order index**: for independent inputs `E f_all (f_i - f_∅) / V` with centred values (Saltelli et al.,
//!   Computer Physics Communications 181 (2010) 259), otherwise `1 - E (f_∅ - f_{all but i})² / 2 V` (Jansen).
//! - **Shapley effect**: along a random order of the inputs the mean of `(f_∅ - f_u)² / 2` grows from 0 to the variance;
//!   what it gains with input `i` is the effect of `i` (Song, Nelson and Staum, SIAM/ASA J. Uncertainty Quantification 4
//!   (2016) 1060; one order per sample: Goda, Reliability Engineering and System Safety 213 (2021) 107673). The effects
//!   add up to one, and each is between zero and one, also for dependent inputs.
//!
//! The points of the total indices, of the order and of `f_all` are shared: a sample costs `2 d` values for `d` inputs,
//! and `3 d` if they are dependent. Standard errors are those of the jackknife over groups of samples (Efron and Stein,
//! Annals of Statistics 9 (1981) 586).

mod inputs;
mod sums;
#[cfg(test)]
mod tests;

use lacuna::math::random::{Stream, permutation};
use lacuna_linalg::Matrix;

pub use self::inputs::{Independent, Inputs};
use self::sums::Sums;

/// Sensitivity of values to inputs: estimates and standard errors, each `values x inputs`. NaN for a value without variance.
#[derive(Debug, Clone, PartialEq)]
pub struct Indices {
    /// First-order Sobol indices.
    pub first: Matrix,
    /// Their standard errors.
    pub first_error: Matrix,
    /// Total Sobol indices.
    pub total: Matrix,
    /// Their standard errors.
    pub total_error: Matrix,
    /// Shapley effects, as shares of the variance.
    pub shapley: Matrix,
    /// Their standard errors.
    pub shapley_error: Matrix,
}

impl Indices {
    /// Indices of no value.
    pub fn none(inputs: usize) -> Self {
        let empty = || Matrix::zeros(0, inputs);
        Self {
            first: empty(),
            first_error: empty(),
            total: empty(),
            total_error: empty(),
            shapley: empty(),
            shapley_error: empty(),
        }
    }

    /// All parts, in the order of the fields.
    pub fn parts(&self) -> [&Matrix; 6] {
        let Self { first, first_error, total, total_error, shapley, shapley_error } = self;
        [first, first_error, total, total_error, shapley, shapley_error]
    }

    /// The indices of the first `count` values, and those of the others.
    pub fn split(&self, count: usize) -> [Self; 2] {
        let all = self.first.rows();
        let rows = |range: std::ops::Range<usize>| {
            let rows: Vec<usize> = range.collect();
            let [first, first_error, total, total_error, shapley, shapley_error] =
                self.parts().map(|part| part.select_rows(&rows));
            Self { first, first_error, total, total_error, shapley, shapley_error }
        };
        [rows(0..count), rows(count..all)]
    }
}

/// Number of samples evaluated together.
const TOGETHER: usize = 50;

/// Largest and smallest number of groups of the jackknife.
const GROUPS: (usize, usize) = (50, 10);

/// Largest number of sums held (256 MiB).
const ROOM: usize = 1 << 25;

/// Number of values that `samples` samples of `d` inputs need.
pub fn evaluations(d: usize, independent: bool, samples: usize) -> usize {
    Plan { d, independent }.points() * samples
}

/// Sensitivity from `samples` samples. `evaluate` gives the values at points, one per row; `keep` is given the number of
/// each sample with the values at its first point, which is [`Inputs::draw`] of `stream.at(number)`.
pub fn indices(
    inputs: &dyn Inputs,
    samples: usize,
    stream: &Stream,
    evaluate: impl Fn(&Matrix) -> Matrix,
    mut keep: impl FnMut(usize, &[f64]),
) -> Indices {
    let plan = Plan { d: inputs.dimension(), independent: inputs.independent() };
    let mut groups: Vec<Sums> = Vec::new();
    let mut centre: Vec<f64> = Vec::new();
    for first in (0..samples).step_by(TOGETHER) {
        let numbers: Vec<usize> = (first..samples.min(first + TOGETHER)).collect();
        let orders: Vec<Vec<usize>> =
            numbers.iter().map(|&i| order(plan.d, &stream.at(i as u64).named("order"))).collect();
        let drawn = numbers.iter().zip(&orders);
        let points = drawn.flat_map(|(&i, order)| plan.sample(inputs, order, &stream.at(i as u64)));
        let values = evaluate(&Matrix::from_rows(plan.d, points));
        if groups.is_empty() {
            let most = ROOM / (values.columns().max(1) * Sums::width(plan.d));
            let count = most.clamp(GROUPS.1, GROUPS.0).min(samples);
            groups = (0..count).map(|_| Sums::new(plan.d, values.columns())).collect();
            centre = (0..values.columns()).map(|j| finite(values.column(j))).collect();
        }
        let count = groups.len();
        for (k, (&i, order)) in numbers.iter().zip(&orders).enumerate() {
            let rows: Vec<&[f64]> =
                (0..plan.points()).map(|p| values.row(k * plan.points() + p)).collect();
            groups[i * count / samples].add(&plan, order, &rows, &centre);
            keep(i, rows[0]);
        }
    }
    Sums::indices(&groups, &plan)
}

/// First finite value: differences from it keep their digits.
fn finite(values: Vec<f64>) -> f64 {
    values.into_iter().find(|value| value.is_finite()).unwrap_or(0.0)
}

/// Points of a sample and their places.
struct Plan {
    d: usize,
    independent: bool,
}

impl Plan {
    /// Number of points of a sample.
    fn points(&self) -> usize {
        match self.d {
            0 | 1 => 1 + self.d,
            d if self.independent => 2 * d,
            d => 3 * d,
        }
    }

    /// Place of the point at which input `i` is drawn anew.
    fn one(i: usize) -> usize {
        1 + i
    }

    /// Place of the point at which the first `k` inputs of the order are drawn anew.
    fn along(&self, order: &[usize], k: usize) -> usize {
        match k {
            0 => 0,
            1 => Self::one(order[0]),
            _ => self.d + k - 1,
        }
    }

    /// Place of the point at which all inputs but `i` are drawn anew, for dependent inputs.
    fn all_but(&self, i: usize) -> usize {
        if self.d == 1 { 0 } else { 2 * self.d + i }
    }

    /// Points of a sample, in their places.
    fn sample(&self, inputs: &dyn Inputs, order: &[usize], stream: &Stream) -> Vec<Vec<f64>> {
        let point = inputs.draw(stream);
        let anew = |free: &dyn Fn(usize) -> bool| {
            let free: Vec<bool> = (0..self.d).map(free).collect();
            inputs.redraw(&point, &free, &stream.named("anew"))
        };
        let mut all = vec![point.clone()];
        all.extend((0..self.d).map(|i| anew(&|j| j == i)));
        all.extend((2..=self.d).map(|k| anew(&|j| order[..k].contains(&j))));
        if !self.independent && self.d > 1 {
            all.extend((0..self.d).map(|i| anew(&|j| j != i)));
        }
        all
    }
}

/// Random order of `d` inputs.
fn order(d: usize, stream: &Stream) -> Vec<usize> {
    permutation(&mut stream.generator(), d)
}
