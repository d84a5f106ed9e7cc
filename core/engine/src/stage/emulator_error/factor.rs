//! Factor by which the error is enlarged so that the shifts of the parameters have the size that its covariance states.

use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, multiply_transposed, symmetric_eigen, transposed_multiply};
use rayon::prelude::*;

use super::size::Size;
use super::taper::Places;
use super::{Curves, ranges, thinned};

/// Largest number of outputs and of curves that are evaluated. The more outputs, the more directions there are in which
/// an estimate trusts the covariance: for the founding study a hundred outputs require a factor of 1.2, three hundred
/// 1.8, all thousand 3.7.
const OUTPUTS: usize = 1000;
const CURVES: usize = 100;

/// Largest numbers of curves and of outputs for which each curve is left out alone; beyond them ten-fold
/// cross-validation is used.
const ALONE: (usize, usize) = (30, 300);
const PARTS: usize = 10;

/// Factors that are tried, ascending.
const FACTORS: [f64; 9] = [1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0];

/// Smallest number of curves from which one can be left out.
const FEWEST: usize = 4;

/// Selected outputs and curves, in units of the noise of the data.
pub struct Shifts<'a> {
    curves: &'a Curves,
    size: &'a Size,
    outputs: Vec<usize>,
    /// Damping of the correlations among the selected outputs.
    damping: Matrix,
    /// Standard deviation of the noise of what was measured, by selected output.
    noise: Vec<f64>,
    /// Curves divided by their sizes and the noise, at the selected outputs.
    white: Matrix,
}

/// An estimate of the parameters, in units of their prior standard deviations, from data with noise of unit variance
/// plus an error.
pub struct Estimate {
    /// Inverse of the covariance that the likelihood states.
    pub precision: Cholesky,
    /// Derivative of the estimate by the data, `parameters x outputs`.
    pub gain: Matrix,
}

impl<'a> Shifts<'a> {
    /// Selects outputs and curves, which are divided by their sizes; `noise` are the variances of what was measured, NaN
    /// where nothing was.
    ///
    /// A subset of the outputs carries less information than all; their noise is reduced to compensate.
    pub fn of(curves: &'a Curves, size: &'a Size, places: &Places, noise: &[f64]) -> Self {
        let measured: Vec<usize> = (0..noise.len()).filter(|&j| !noise[j].is_nan()).collect();
        let outputs: Vec<usize> =
            thinned(measured.len(), OUTPUTS).into_iter().map(|k| measured[k]).collect();
        // With `n` of `N` outputs the information falls to `n / N`; a variance of the noise reduced by the same ratio
        // restores it.
        let share = outputs.len() as f64 / measured.len().max(1) as f64;
        let noise: Vec<f64> = outputs.iter().map(|&j| (share * noise[j]).sqrt()).collect();
        let (damping, white) = (places.among(&outputs), Matrix::zeros(0, 0));
        let mut judged = Self { curves, size, outputs, damping, noise, white };
        judged.white = judged.whitened(|i, j| curves.errors[(i, j)] / size.at_curves[i]);
        judged
    }

    fn whitened(&self, curve: impl Fn(usize, usize) -> f64) -> Matrix {
        Matrix::from_fn(self.curves.errors.rows(), self.outputs.len(), |i, k| {
            curve(i, self.outputs[k]) / self.noise[k]
        })
    }

    /// Derivatives by the parameters at the selected outputs.
    pub fn slopes(&self, slopes: &Matrix) -> Matrix {
        Matrix::from_fn(self.outputs.len(), slopes.columns(), |k, p| {
            slopes[(self.outputs[k], p)] / self.noise[k]
        })
    }

    /// Tapered mean square of the curves at the selected outputs, with their sizes.
    pub fn covariance(&self) -> Matrix {
        self.damped(&self.whitened(|i, j| self.curves.errors[(i, j)]))
    }

    fn damped(&self, white: &Matrix) -> Matrix {
        let products = transposed_multiply(white, white);
        let count = white.rows().max(1) as f64;
        Matrix::from_fn(self.outputs.len(), self.outputs.len(), |i, j| {
            products[(i, j)] / count * self.damping[(i, j)]
        })
    }

    /// The factor on the error at which the mean square of the shifts of the parameters, relative to their posterior
    /// covariance, is one. Each curve plus noise is treated as the difference between data and emulator at a run whose
    /// parameters are the truth; the other curves give the covariance. The truth may be anywhere, and emulators are
    /// worst at the edges of their runs: if the half of the runs nearest to the edges requires a larger factor, that
    /// one is used. `slopes` returns the derivatives of the outputs by the parameters, per prior standard deviation.
    ///
    /// Few curves determine the covariance of as many parameters poorly: the factor is therefore enlarged by
    /// `sqrt((n - 1) / (n - p - 2))` (Hartlap, Simon and Schneider, Astronomy and Astrophysics 464 (2007) 399;
    /// Sellentin and Heavens, Monthly Notices of the Royal Astronomical Society 456 (2016) L132).
    pub fn factor(&self, slopes: &dyn Fn(&[f64]) -> Matrix) -> f64 {
        let (curves, parameters) = (self.white.rows(), self.curves.points.columns());
        if curves < 2 || self.white.as_slice().iter().all(|e| *e == 0.0) {
            return 1.0;
        }
        let few = (curves as f64 - 1.0) / (curves as f64 - parameters as f64 - 2.0).max(1.0);
        let own = if curves < FEWEST { 1.0 } else { self.enlarged(slopes) };
        own * few.sqrt()
    }

    fn enlarged(&self, slopes: &dyn Fn(&[f64]) -> Matrix) -> f64 {
        let count = self.white.rows();
        let is_alone = count <= ALONE.0 && self.outputs.len() <= ALONE.1;
        let parts = if is_alone { count } else { PARTS };
        let judged = thinned(count, CURVES);
        let slopes: Vec<Matrix> =
            judged.iter().map(|&i| self.slopes(&slopes(self.curves.points.row(i)))).collect();
        let of_part = |part: usize| -> Vec<(usize, [f64; FACTORS.len()])> {
            let mine: Vec<usize> =
                (0..judged.len()).filter(|&k| judged[k] % parts == part).collect();
            if mine.is_empty() {
                return Vec::new();
            }
            let others: Vec<usize> = (0..count).filter(|i| i % parts != part).collect();
            // One decomposition serves all factors: in the axes of the covariance, changing the factor only scales the
            // variances.
            let axes = Axes::of(&self.damped(&self.white.select_rows(&others)));
            mine.into_iter()
                .map(|k| (k, self.squares(judged[k], axes.as_ref(), &slopes[k])))
                .collect()
        };
        let mut squares = vec![[f64::NAN; FACTORS.len()]; judged.len()];
        let found: Vec<_> = (0..parts).into_par_iter().flat_map_iter(of_part).collect();
        for (k, own) in found {
            squares[k] = own;
        }
        let outer = outer(&self.curves.points.select_rows(&judged));
        let near_edges = outer.iter().map(|&k| squares[k]).collect::<Vec<_>>();
        crossing(&means(&squares)).max(crossing(&means(&near_edges)))
    }

    /// For each factor the expected squared shift caused by a curve, for a covariance multiplied by the squared factor;
    /// NaN if the emulator has no derivatives at its run, or the covariance no eigendecomposition.
    fn squares(&self, curve: usize, axes: Option<&Axes>, slopes: &Matrix) -> [f64; FACTORS.len()] {
        let Some(axes) = axes else { return [f64::NAN; FACTORS.len()] };
        let size = self.size.at_curves[curve];
        let error: Vec<f64> = self.white.row(curve).iter().map(|e| e * size).collect();
        let slopes = transposed_multiply(&axes.vectors, slopes);
        let error = transposed_multiply(&axes.vectors, &Matrix::from_vec(error.len(), 1, error));
        FACTORS.map(|factor| {
            Estimate::of(&axes.variances, (factor * size).powi(2), &slopes)
                .map_or(f64::NAN, |estimate| estimate.square(error.as_slice()))
        })
    }
}

/// Principal axes of a covariance.
struct Axes {
    /// Variance along each axis.
    variances: Vec<f64>,
    /// Axes, one per column.
    vectors: Matrix,
}

impl Axes {
    fn of(covariance: &Matrix) -> Option<Self> {
        let eigen = symmetric_eigen(covariance).ok()?;
        // Rounding makes zero eigenvalues slightly positive or negative.
        let variances = eigen.values.iter().map(|v| v.max(0.0)).collect();
        Some(Self { variances, vectors: eigen.vectors })
    }
}

/// The half of some points that have a coordinate nearest to an end of its range.
fn outer(points: &Matrix) -> Vec<usize> {
    let ranges = ranges(points);
    let off = |i: usize| {
        let each = points.row(i).iter().zip(&ranges);
        each.map(|(x, (low, high))| ((x - low) / (high - low) - 0.5).abs()).fold(0.0, f64::max)
    };
    let mut order: Vec<usize> = (0..points.rows()).collect();
    order.sort_by(|&a, &b| off(b).total_cmp(&off(a)));
    order.truncate(points.rows().div_ceil(2));
    order.sort_unstable();
    order
}

/// Mean square for each factor over the curves that have a value.
fn means(squares: &[[f64; FACTORS.len()]]) -> [f64; FACTORS.len()] {
    std::array::from_fn(|f| {
        let known: Vec<f64> = squares.iter().map(|s| s[f]).filter(|s| s.is_finite()).collect();
        known.iter().sum::<f64>() / known.len().max(1) as f64
    })
}

/// The factor at which the mean square falls to one, interpolated between those that were tried. Beyond them the mean
/// square is taken as inversely proportional to the squared factor, as it is if the error is large compared with the
/// noise.
fn crossing(means: &[f64; FACTORS.len()]) -> f64 {
    let Some(after) = means.iter().position(|square| *square <= 1.0) else {
        let last = FACTORS.len() - 1;
        return FACTORS[last] * means[last].sqrt();
    };
    let Some(before) = after.checked_sub(1) else { return FACTORS[0] };
    let share = (means[before] - 1.0) / (means[before] - means[after]);
    FACTORS[before] + share * (FACTORS[after] - FACTORS[before])
}

impl Estimate {
    /// Estimate by generalised least squares with the prior, for an error whose variance along each axis of the data is
    /// `scale` times that given; `slopes` are along the same axes. `None` if the slopes are undefined.
    pub fn of(variances: &[f64], scale: f64, slopes: &Matrix) -> Option<Self> {
        let solved = Matrix::from_fn(slopes.rows(), slopes.columns(), |i, j| {
            slopes[(i, j)] / (1.0 + scale * variances[i])
        });
        let mut precision = transposed_multiply(slopes, &solved);
        // Precision of the prior, which is one in units of its standard deviation.
        (0..precision.rows()).for_each(|k| precision[(k, k)] += 1.0);
        let precision = Cholesky::new(&precision).ok()?;
        let gain = multiply_transposed(&precision.inverse(), &solved);
        Some(Self { precision, gain })
    }

    /// Expected squared shift caused by an error and the noise, relative to the covariance of the estimate and divided
    /// by the number of parameters.
    fn square(&self, error: &[f64]) -> f64 {
        // With precision L L' the square of a shift d is |L' d|^2.
        let half = |shift: &[f64]| {
            let lower = self.precision.lower();
            let turned = |k: usize| (k..shift.len()).map(|i| lower[(i, k)] * shift[i]).sum::<f64>();
            (0..shift.len()).map(|k| turned(k).powi(2)).sum::<f64>()
        };
        let shift: Vec<f64> = self.gain.iter_rows().map(|row| dot(row, error)).collect();
        let of_noise: f64 = (0..self.gain.columns()).map(|j| half(&self.gain.column(j))).sum();
        (half(&shift) + of_noise) / shift.len().max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For an error `a` times as large as stated, without noise, the mean square is `(a / factor)^2`: the required
    /// factor is `a`, exactly at the factors that are tried and beyond them.
    #[test]
    fn the_factor_is_by_what_the_error_is_larger() {
        for (larger, found) in [(0.5, 1.0), (1.5, 1.5), (4.0, 4.0), (20.0, 20.0)] {
            let factor: f64 = crossing(&FACTORS.map(|f| f64::powi(larger / f, 2)));
            assert!((factor - found).abs() < 1e-12, "{larger}: {factor}");
        }
    }

    #[test]
    fn curves_without_a_slope_have_no_say() {
        let squares = [[4.0; FACTORS.len()], [f64::NAN; FACTORS.len()], [2.0; FACTORS.len()]];
        assert_eq!(means(&squares).map(f64::to_bits), [3.0_f64.to_bits(); FACTORS.len()]);
    }
}
