//! Gaussian process of a limit state.

use lacuna::math::random::Stream;
use lacuna_linalg::Matrix;

use crate::surrogates::kriging::{Bounds, Choice, Field, Kernel, Nugget, Restricted, Runs, search};

/// A Gaussian process conditioned on the calls of the model, with a polynomial trend.
pub struct Process {
    field: Field,
    trend: Trend,
    centre: f64,
    scale: f64,
}

/// Polynomial trend of a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Trend {
    Constant,
    Linear,
    Quadratic,
}

impl Trend {
    const ALL: [Self; 3] = [Self::Constant, Self::Linear, Self::Quadratic];

    /// Number of terms in this dimension.
    fn terms(self, d: usize) -> usize {
        match self {
            Self::Constant => 1,
            Self::Linear => 1 + d,
            Self::Quadratic => 1 + d + d * (d + 1) / 2,
        }
    }

    /// Terms at each row of points.
    fn values(self, points: &Matrix) -> Matrix {
        let d = points.columns();
        Matrix::from_rows(
            self.terms(d),
            points.iter_rows().map(|u| {
                let mut row = vec![1.0];
                if self != Self::Constant {
                    row.extend_from_slice(u);
                }
                if self == Self::Quadratic {
                    row.extend((0..d).flat_map(|i| (0..=i).map(move |j| u[i] * u[j])));
                }
                row
            }),
        )
    }
}

/// Nugget for a response without noise, which keeps the covariance of near points regular.
const NUGGET: f64 = 1e-10;
/// Bounds of the length scales, in standard deviations of the variables.
const LENGTHS: [f64; 2] = [0.2, 50.0];
const STARTS: usize = 3;
/// Runs per term that a trend needs.
const PER_TERM: f64 = 1.5;

impl Process {
    /// Fits a process to values at the rows of points. The trend with the smallest error of the left-out runs is taken.
    /// `None` if the values are equal or no process can be fitted.
    pub fn fit(kernel: Kernel, points: &Matrix, values: &[f64], stream: &Stream) -> Option<Self> {
        let n = values.len() as f64;
        let centre = values.iter().sum::<f64>() / n;
        let scale = (values.iter().map(|v| (v - centre).powi(2)).sum::<f64>() / n).sqrt();
        if !(scale > 0.0 && scale.is_finite()) {
            return None;
        }
        let scores = Matrix::from_fn(values.len(), 1, |i, _| (values[i] - centre) / scale);
        let columns = points.transposed();
        let mut best: Option<(f64, Self)> = None;
        for trend in Trend::ALL {
            let terms = trend.terms(points.columns());
            if trend != Trend::Constant && (terms as f64 * PER_TERM) > n {
                continue;
            }
            let regressors = trend.values(points);
            let problem = Restricted {
                kernel,
                points: &columns,
                trend: &regressors,
                scores: &scores,
                bounds: Bounds { length_scale: LENGTHS, nugget: [NUGGET, 1.0] },
                nugget: Nugget::Fixed(NUGGET),
            };
            let Some(found) = search(&problem, STARTS, stream) else { continue };
            let choice = Choice::new(vec![0], (0..terms).collect(), found);
            let runs = Runs { points: &columns, regressors: &regressors, scores: &scores };
            let Some(field) = Field::new(kernel, choice, runs) else { continue };
            let error: f64 = field.left_out().as_slice().iter().map(|e| e * e).sum();
            if error.is_finite() && best.as_ref().is_none_or(|(least, _)| error < *least) {
                best = Some((error, Self { field, trend, centre, scale }));
            }
        }
        best.map(|(_, process)| process)
    }

    /// Means at the rows of points.
    pub fn mean(&self, points: &Matrix) -> Vec<f64> {
        let mean = self.field.mean(&points.transposed(), &self.trend.values(points));
        mean.as_slice().iter().map(|m| self.centre + self.scale * m).collect()
    }

    /// Standard deviations at the rows of points, enlarged if the errors of the left-out runs are larger than the process
    /// says.
    pub fn deviation(&self, points: &Matrix) -> Vec<f64> {
        let variance = self.field.variance(&points.transposed(), &self.trend.values(points));
        let factor = self.scale * self.field.left_out_ratio().max(1.0).sqrt();
        variance.as_slice().iter().map(|v| factor * v.sqrt()).collect()
    }

    /// Covariances among the rows of points.
    pub fn covariance(&self, points: &Matrix) -> Matrix {
        let mut all = self.field.covariance(&points.transposed(), &self.trend.values(points));
        all.as_mut_slice().iter_mut().for_each(|c| *c *= self.scale * self.scale);
        all
    }
}
