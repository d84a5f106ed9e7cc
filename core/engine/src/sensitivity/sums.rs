//! Sums over samples from which indices follow, one set per group of the jackknife.

use lacuna_linalg::Matrix;

use super::{Indices, Plan};

/// Sums of a group of samples; samples at which a value is not finite are left out of the sums of this value.
#[derive(Clone)]
pub(super) struct Sums {
    d: usize,
    /// For each value [`Self::width`] sums.
    all: Vec<f64>,
}

/// Places of the sums of the samples' number, and of the values and squares at the first and at the last point.
const COUNT: usize = 0;
const FIRST: usize = 1;
const LAST: usize = 3;
/// Place of the first sum of an input; there are four for each.
const INPUTS: usize = 5;
const EACH: usize = 4;

impl Sums {
    /// Number of sums for each value.
    pub fn width(d: usize) -> usize {
        INPUTS + EACH * d
    }

    pub fn new(d: usize, values: usize) -> Self {
        Self { d, all: vec![0.0; values * Self::width(d)] }
    }

    /// Adds a sample with these values at its points.
    pub fn add(&mut self, plan: &Plan, order: &[usize], rows: &[&[f64]], centre: &[f64]) {
        let width = Self::width(self.d);
        for (j, sums) in self.all.chunks_exact_mut(width).enumerate() {
            if rows.iter().any(|row| !row[j].is_finite()) {
                continue;
            }
            let at = |place: usize| rows[place][j] - centre[j];
            let (first, last) = (at(0), at(plan.along(order, self.d)));
            sums[COUNT] += 1.0;
            sums[FIRST] += first;
            sums[FIRST + 1] += first * first;
            sums[LAST] += last;
            sums[LAST + 1] += last * last;
            let half = |place: usize| 0.5 * (first - at(place)).powi(2);
            for i in 0..self.d {
                let own = &mut sums[INPUTS + EACH * i..INPUTS + EACH * (i + 1)];
                let moved = at(Plan::one(i)) - first;
                own[0] += if plan.independent { last * moved } else { half(plan.all_but(i)) };
                own[1] += moved;
                own[2] += half(Plan::one(i));
            }
            for k in 1..=self.d {
                let gain = half(plan.along(order, k)) - half(plan.along(order, k - 1));
                sums[INPUTS + EACH * order[k - 1] + 3] += gain;
            }
        }
    }

    /// Estimates with their jackknife errors.
    pub fn indices(groups: &[Self], plan: &Plan) -> Indices {
        let d = plan.d;
        let values = groups.first().map_or(0, |group| group.all.len() / Self::width(d));
        let zero = || Matrix::zeros(values, d);
        let mut found: [Matrix; 3] = [zero(), zero(), zero()];
        let mut errors: [Matrix; 3] = [zero(), zero(), zero()];
        for j in 0..values {
            let part = |group: &Self| {
                let width = Self::width(d);
                group.all[j * width..(j + 1) * width].to_vec()
            };
            let parts: Vec<Vec<f64>> = groups.iter().map(part).collect();
            let without = |left: Option<usize>| {
                let kept = parts.iter().enumerate().filter(|(g, _)| Some(*g) != left);
                let mut sum = vec![0.0; Self::width(d)];
                kept.for_each(|(_, part)| sum.iter_mut().zip(part).for_each(|(s, x)| *s += x));
                estimates(&sum, plan)
            };
            let whole = without(None);
            let left_out: Vec<[Vec<f64>; 3]> =
                (0..groups.len()).map(|g| without(Some(g))).collect();
            let count = groups.len() as f64;
            for kind in 0..3 {
                for i in 0..d {
                    let each = || left_out.iter().map(|estimate| estimate[kind][i]);
                    let mean = each().sum::<f64>() / count;
                    let square = each().map(|x| (x - mean).powi(2)).sum::<f64>();
                    found[kind][(j, i)] = whole[kind][i];
                    errors[kind][(j, i)] = (square * (count - 1.0) / count).sqrt();
                }
            }
        }
        let [first, total, shapley] = found;
        let [first_error, total_error, shapley_error] = errors;
        Indices { first, first_error, total, total_error, shapley, shapley_error }
    }
}

/// First-order indices, total indices and Shapley effects from sums; NaN without variance.
fn estimates(sums: &[f64], plan: &Plan) -> [Vec<f64>; 3] {
    let n = sums[COUNT];
    let mean = (sums[FIRST] + sums[LAST]) / (2.0 * n);
    let square = (sums[FIRST + 1] + sums[LAST + 1]) / (2.0 * n);
    let variance = square - mean * mean;
    // Below the rounding error of the sums nothing varies.
    let variance = if variance > 1e-13 * square { variance } else { f64::NAN };
    let own = |i: usize, k: usize| sums[INPUTS + EACH * i + k] / n;
    let gained: f64 = (0..plan.d).map(|i| own(i, 3)).sum();
    let first = |i: usize| {
        if plan.independent {
            (own(i, 0) - mean * own(i, 1)) / variance
        } else {
            1.0 - own(i, 0) / variance
        }
    };
    let shapley = |i: usize| if variance.is_nan() { f64::NAN } else { own(i, 3) / gained };
    [
        (0..plan.d).map(first).collect(),
        (0..plan.d).map(|i| own(i, 2) / variance).collect(),
        (0..plan.d).map(shapley).collect(),
    ]
}
