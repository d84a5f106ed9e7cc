//! Variation of the size of the emulator's error over the input space.
//!
//! `log s(x) = m + b (log v(x) - mean log v)` with a variance `v`: that which the emulator states or, with enough runs,
//! the kriging variance of a process conditioned on the other runs. `b` is found by least squares from the logarithms
//! of the curves' sizes and shrunk toward 1/2, for which `s^2` is proportional to `v`.

use lacuna::math::moments::mean;
use lacuna::plugin::Forward;
use lacuna_linalg::Matrix;

use super::kriging::Kriging;
use super::{Curves, ranges, thinned};

/// Length scales that are tried, in units of the range of the runs times the square root of a third of the number of
/// parameters.
const LENGTHS: [f64; 3] = [0.3, 0.6, 1.2];

/// Smallest number of curves from which the variation is learned without a stated variance.
const ENOUGH: usize = 50;

/// Smallest number of curves from which a stated variance is scaled.
const FEWEST: usize = 8;

/// Largest number of runs used for distances.
const MOST: usize = 200;

/// Mean and standard deviation of the prior of `b`.
const PRIOR: (f64, f64) = (0.5, 0.3);
/// Variance of the logarithm of a curve's size about the line.
const SCATTER: f64 = 0.3;

/// Size at each point relative to that of the shapes.
#[derive(Debug, Clone)]
pub struct Size {
    law: Law,
    /// `m`, `b` and the mean of `log v`.
    level: f64,
    exponent: f64,
    centre: f64,
    /// Sizes at the runs of the curves.
    pub at_curves: Vec<f64>,
}

#[derive(Debug, Clone)]
enum Law {
    /// One size for all points.
    Constant,
    /// From the stated variance, with the scale of each output.
    Stated(Vec<f64>),
    /// From the distance to the runs.
    Distance { ranges: Vec<(f64, f64)>, kriging: Kriging },
}

impl Size {
    /// Learns the size from error curves.
    pub fn learned(curves: &Curves) -> Self {
        let runs = curves.points.rows();
        let constant = Self {
            law: Law::Constant,
            level: 0.0,
            exponent: 0.0,
            centre: 0.0,
            at_curves: vec![1.0; runs],
        };
        if runs < FEWEST || curves.errors.as_slice().iter().all(|e| *e == 0.0) {
            return constant;
        }
        let logs: Vec<f64> = sizes(&curves.errors).iter().map(|q| q.ln()).collect();
        let mut best = (criterion(&logs, 0.0, &vec![0.0; runs]), constant);
        let mut candidates = Vec::new();
        if let Some(stated) = &curves.stated {
            let scale = output_scales(stated, |_, variance| variance);
            let variances = stated.iter_rows().map(|row| relative(row, &scale)).collect();
            candidates.push((Law::Stated(scale), variances));
        }
        if runs >= ENOUGH {
            candidates.extend(distances(curves));
        }
        for (law, variances) in candidates {
            let found = Self::fitted(&logs, law, &variances);
            let value = found.0 + 1.0;
            if value < best.0 {
                best = (value, found.1);
            }
        }
        best.1
    }

    fn fitted(logs: &[f64], law: Law, variances: &[f64]) -> (f64, Self) {
        let of: Vec<f64> = variances.iter().map(|v| v.ln()).collect();
        let (centre, level) = (mean(&of), mean(logs));
        let x: Vec<f64> = of.iter().map(|v| v - centre).collect();
        let (slope, width) = (PRIOR.0, PRIOR.1 * PRIOR.1);
        let cross: f64 = x.iter().zip(logs).map(|(x, q)| x * (q - level)).sum();
        let square: f64 = x.iter().map(|x| x * x).sum();
        let exponent = (cross / SCATTER + slope / width) / (square / SCATTER + 1.0 / width);
        let exponent = exponent.clamp(0.0, 1.5);
        let value = criterion(logs, exponent, &x) + (exponent - slope).powi(2) / width;
        let at_curves = x.iter().map(|x| (level + exponent * x).exp()).collect();
        (value, Self { law, level, exponent, centre, at_curves })
    }

    /// Returns true if the size depends on the parameters.
    pub fn varies(&self) -> bool {
        !matches!(self.law, Law::Constant)
    }

    /// Sizes at points in physical units, one per row of `points`.
    pub fn values(&self, forward: &dyn Forward, points: &Matrix) -> Option<Vec<f64>> {
        let variances: Vec<f64> = match &self.law {
            Law::Constant => return Some(vec![1.0; points.rows()]),
            Law::Stated(scale) => {
                forward.variance(points)?.iter_rows().map(|row| relative(row, scale)).collect()
            }
            Law::Distance { ranges, kriging } => {
                points.iter_rows().map(|point| kriging.variance(&unit(point, ranges))).collect()
            }
        };
        let size = |v: &f64| (self.level + self.exponent * (v.ln() - self.centre)).exp();
        Some(variances.iter().map(size).collect())
    }
}

/// Logarithm of the residual variance times the number of curves.
fn criterion(logs: &[f64], exponent: f64, x: &[f64]) -> f64 {
    let level = mean(logs);
    let rest = logs.iter().zip(x).map(|(q, x)| (q - level - exponent * x).powi(2)).sum::<f64>();
    let count = logs.len() as f64;
    // The constant keeps a perfect fit of few curves from an infinitely good criterion.
    count * (rest / count + 0.02).ln()
}

/// Size of each curve: the root mean square over the outputs, each relative to its own errors over curves scaled to
/// size one; the geometric mean of the sizes is one.
fn sizes(errors: &Matrix) -> Vec<f64> {
    let mut sizes = vec![1.0; errors.rows()];
    // Sizes and scales of the outputs depend on each other; a few fixed-point iterations separate them.
    for _ in 0..5 {
        let scale = output_scales(errors, |i, e| (e / sizes[i]).powi(2));
        let square = |row: &[f64]| -> f64 {
            let each = row.iter().zip(&scale).map(|(e, v)| e * e / v);
            each.sum::<f64>() / row.len() as f64
        };
        sizes = errors.iter_rows().map(|row| square(row).sqrt()).collect();
        let least = 1e-3 * sizes.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        for q in &mut sizes {
            *q = q.max(least);
        }
    }
    let logs: Vec<f64> = sizes.iter().map(|q| q.ln()).collect();
    let level = mean(&logs).exp();
    sizes.iter().map(|q| q / level).collect()
}

/// Mean of `of` each entry of a column and its row, plus a thousandth of the overall mean, so that an output with almost
/// no errors gets almost no weight.
fn output_scales(values: &Matrix, of: impl Fn(usize, f64) -> f64) -> Vec<f64> {
    let mut sums = vec![0.0; values.columns()];
    for (i, row) in values.iter_rows().enumerate() {
        sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += of(i, *value));
    }
    let each: Vec<f64> = sums.iter().map(|sum| sum / values.rows() as f64).collect();
    let floor = (1e-3 * mean(&each)).max(f64::MIN_POSITIVE);
    each.iter().map(|v| v + floor).collect()
}

fn relative(variances: &[f64], scale: &[f64]) -> f64 {
    let each = variances.iter().zip(scale).map(|(v, s)| v / s);
    (each.sum::<f64>() / variances.len() as f64).max(1e-12)
}

/// Kriging variances at the runs of the curves, each left out.
fn distances(curves: &Curves) -> Vec<(Law, Vec<f64>)> {
    let points = &curves.points;
    let ranges = ranges(points);
    let places =
        Matrix::from_rows(points.columns(), points.iter_rows().map(|point| unit(point, &ranges)));
    let chosen = thinned(points.rows(), MOST);
    let known = places.select_rows(&chosen);
    let root = (points.columns() as f64 / 3.0).sqrt();
    let law = |length: f64| {
        let kriging = Kriging::new(&known, length * root)?;
        let own = kriging.left_out();
        let variance = |i: usize| match chosen.binary_search(&i) {
            Ok(k) => own[k],
            Err(_) => kriging.variance(places.row(i)),
        };
        let variances = (0..points.rows()).map(variance).collect();
        Some((Law::Distance { ranges: ranges.clone(), kriging }, variances))
    };
    LENGTHS.into_iter().filter_map(law).collect()
}

fn unit(point: &[f64], ranges: &[(f64, f64)]) -> Vec<f64> {
    point.iter().zip(ranges).map(|(x, (low, high))| (x - low) / (high - low)).collect()
}
