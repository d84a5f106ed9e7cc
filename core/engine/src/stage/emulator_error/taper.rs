//! Covariance of curves with tapered correlations.

use lacuna::data::{Coordinates, Layouts};
use lacuna::run::Stop;
use lacuna_linalg::{Matrix, multiply, symmetric_eigen, transposed_multiply};
use rayon::prelude::*;

use super::{column_squares, thinned};

/// Length over which correlations are damped, as a fraction of an axis.
const LENGTH: f64 = 0.15;

/// Damping factor of a correlation between two labels of an axis, or two blocks of scenarios.
const APART: f64 = 0.7;

/// Number of outputs whose covariance is decomposed; the result is extended to the others.
const OUTPUTS: usize = 1000;

/// Number of outputs to which it is extended at a time.
const BLOCK: usize = 8192;

/// Directions with a variance below this fraction of the smallest noise are omitted, and no others: along omitted
/// directions the emulator counts as exact, and estimates trust them. A hundred of a thousand directions may contain
/// almost all of the variance, and an estimate from the rest is still as confident as without any error.
const SEEN: f64 = 0.01;

/// Position of each output: its block, and along each axis a fraction of the axis or a label.
pub struct Places {
    all: Vec<(usize, Vec<(f64, usize)>)>,
}

impl Places {
    /// Positions of all outputs of a study.
    pub fn of(layouts: &Layouts) -> Self {
        let mut all = Vec::with_capacity(layouts.len());
        for (block, (layout, _)) in layouts.parts().enumerate() {
            for output in 0..layout.len() {
                let axes = layout.axes.iter().zip(layout.place(output));
                let place = |(axis, i): (&lacuna::data::Axis, usize)| match axis.coordinates {
                    Coordinates::Grid { .. } => (i as f64 / axis.len().max(2) as f64, 0),
                    Coordinates::Labels { .. } => (0.0, i),
                };
                all.push((block, axes.map(place).collect()));
            }
        }
        Self { all }
    }

    /// Damping of the correlation between two outputs: a product of correlation functions and therefore a correlation
    /// itself, so that the elementwise product with a covariance is a covariance (Schur).
    pub fn damping(&self, i: usize, j: usize) -> f64 {
        let ((block, a), (other, b)) = (&self.all[i], &self.all[j]);
        let mut product = if block == other { 1.0 } else { APART };
        for k in 0..a.len().max(b.len()) {
            let missing = (0.0, 0);
            let (x, y) = (a.get(k).unwrap_or(&missing), b.get(k).unwrap_or(&missing));
            if x.0 != y.0 {
                product *= (-0.5 * ((x.0 - y.0) / LENGTH).powi(2)).exp();
            }
            product *= if x.1 == y.1 { 1.0 } else { APART };
        }
        product
    }

    /// Damping of the correlations among some outputs.
    pub fn among(&self, outputs: &[usize]) -> Matrix {
        let below = |i: usize| -> Vec<f64> {
            outputs[..=i].iter().map(|&j| self.damping(outputs[i], j)).collect()
        };
        let lower: Vec<Vec<f64>> = (0..outputs.len()).into_par_iter().map(below).collect();
        Matrix::from_fn(outputs.len(), outputs.len(), |i, j| lower[i.max(j)][i.min(j)])
    }

    /// Covariance of some curves, one per row and multiplied by its own scale, as a factor of low rank,
    /// `outputs x rank`; `noise` is the variance of what was measured by output, NaN where nothing was.
    ///
    /// For many outputs the covariance of a subset is decomposed and extended to all (Nyström); each output keeps its
    /// variance.
    pub fn factor(&self, curves: &Scaled<'_>, noise: &[f64]) -> Result<Matrix, Stop> {
        let outputs = curves.errors.columns();
        let few = thinned(outputs, OUTPUTS);
        let known = curves.at(&few);
        let directions = self.directions(&known, &few, noise)?;
        let all: Vec<usize> = (0..outputs).collect();
        let blocks: Vec<Matrix> = all
            .par_chunks(BLOCK)
            .map(|some| self.extended(&curves.at(some), some, (&known, &few), &directions))
            .collect();
        Ok(Matrix::from_rows(directions.columns(), blocks.iter().flat_map(Matrix::iter_rows)))
    }

    /// Directions of the covariance of the curves at few outputs, each divided by its standard deviation.
    fn directions(&self, known: &Matrix, few: &[usize], noise: &[f64]) -> Result<Matrix, Stop> {
        let count = known.rows().max(1) as f64;
        let (among, damping) = (transposed_multiply(known, known), self.among(few));
        let among =
            Matrix::from_fn(few.len(), few.len(), |i, j| among[(i, j)] / count * damping[(i, j)]);
        let eigen = symmetric_eigen(&among)
            .map_err(|e| Stop::new(format!("the covariance of the emulator's error: {e}")))?;
        let least = noise.iter().copied().filter(|v| !v.is_nan()).fold(f64::INFINITY, f64::min);
        let largest = eigen.values.last().copied().unwrap_or(0.0);
        let floor = if least.is_finite() { SEEN * least } else { 0.0 };
        let floor = floor.min(0.1 * largest).max(1e-9 * largest);
        let kept: Vec<usize> = (0..few.len()).rev().filter(|&k| eigen.values[k] > floor).collect();
        Ok(Matrix::from_fn(few.len(), kept.len(), |i, k| {
            eigen.vectors[(i, kept[k])] / eigen.values[kept[k]].sqrt()
        }))
    }

    /// Rows of the factor for some outputs.
    fn extended(
        &self,
        curves: &Matrix,
        outputs: &[usize],
        (known, few): (&Matrix, &[usize]),
        directions: &Matrix,
    ) -> Matrix {
        let count = curves.rows().max(1) as f64;
        let across = transposed_multiply(curves, known);
        let across = Matrix::from_fn(outputs.len(), few.len(), |i, j| {
            across[(i, j)] / count * self.damping(outputs[i], few[j])
        });
        let mut factor = multiply(&across, directions);
        for (j, square) in column_squares(curves).into_iter().enumerate() {
            // Omitted directions and the extension to all outputs lose variance, which is restored output by output.
            let variance = square / count;
            let kept = factor.row(j).iter().map(|f| f * f).sum::<f64>();
            let grow = if kept > 0.0 { (variance / kept).sqrt().clamp(1.0, 2.0) } else { 1.0 };
            factor.row_mut(j).iter_mut().for_each(|f| *f *= grow);
        }
        factor
    }
}

/// Curves of which each has a scale of its own.
pub struct Scaled<'a> {
    /// Curves, one per row.
    pub errors: &'a Matrix,
    /// Divisor of each curve; `None` for one.
    pub divisors: Option<&'a [f64]>,
    /// Factor on all curves, after the division.
    pub factor: f64,
}

impl<'a> Scaled<'a> {
    /// Curves as they are.
    pub fn plain(errors: &'a Matrix) -> Self {
        Self { errors, divisors: None, factor: 1.0 }
    }

    /// The scaled curves at some outputs.
    fn at(&self, outputs: &[usize]) -> Matrix {
        let divisor = |i: usize| self.divisors.map_or(1.0, |all| all[i]);
        Matrix::from_fn(self.errors.rows(), outputs.len(), |i, k| {
            self.factor * (self.errors[(i, outputs[k])] / divisor(i))
        })
    }
}
