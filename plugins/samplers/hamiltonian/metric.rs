//! Metric learnt from the draws of the chains.

use lacuna::math::moments::Moments;
use lacuna_linalg::{Cholesky, Matrix, multiply_vector, transposed_multiply_vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Form of the learnt covariance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Variances only: cheaper steps, for many or weakly correlated unknowns.
    Diagonal,
    /// Variances and all correlations: longer steps if unknowns are correlated, at a cost of `d^2` per step.
    Dense,
}

/// A covariance `F F'`, stored by its factor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) enum Metric {
    /// Diagonal of `F`, i.e. the standard deviations.
    Diagonal(Vec<f64>),
    /// Lower triangular factor `F`.
    Dense(Matrix),
}

impl Metric {
    /// Returns the metric of a covariance (`d x d`); `None` if it is not positive definite.
    pub fn of(shape: Shape, covariance: &Matrix) -> Option<Self> {
        match shape {
            Shape::Diagonal => {
                let sd: Vec<f64> =
                    (0..covariance.rows()).map(|j| covariance[(j, j)].sqrt()).collect();
                let good = sd.iter().all(|s| *s > 0.0 && s.is_finite());
                good.then_some(Self::Diagonal(sd))
            }
            Shape::Dense => Cholesky::new(covariance).ok().map(|c| Self::Dense(c.lower().clone())),
        }
    }

    /// Returns `F z`.
    pub fn push(&self, z: &[f64]) -> Vec<f64> {
        match self {
            Self::Diagonal(sd) => sd.iter().zip(z).map(|(s, z)| s * z).collect(),
            Self::Dense(factor) => multiply_vector(factor, z),
        }
    }

    /// Returns `F' g`.
    pub fn pull(&self, g: &[f64]) -> Vec<f64> {
        match self {
            Self::Diagonal(_) => self.push(g),
            Self::Dense(factor) => transposed_multiply_vector(factor, g),
        }
    }

    fn covariance(&self) -> Matrix {
        match self {
            Self::Diagonal(sd) => {
                Matrix::from_fn(sd.len(), sd.len(), |i, j| if i == j { sd[i] * sd[i] } else { 0.0 })
            }
            Self::Dense(factor) => lacuna_linalg::multiply_transposed(factor, factor),
        }
    }

    /// Replaces the metric by the covariance of the draws of one window, pooled over the chains.
    ///
    /// Deviations are taken from the mean of each chain, so that chains that have not yet met do not inflate the
    /// covariance. The estimate is shrunk slightly as in Stan, but in units of the present metric: `n / (n + 5)` of
    /// the estimate plus `0.001 * 5 / (n + 5)` of the present covariance. The metric is kept if the result is not
    /// positive definite.
    pub fn learn(&mut self, shape: Shape, spreads: &[Spread]) {
        let d = spreads.first().map_or(0, Spread::dimension);
        let degrees: f64 = spreads.iter().map(Spread::degrees).sum();
        let (own, present) = (1.0 / (degrees + 5.0), 5e-3 / (degrees + 5.0));
        let before = self.covariance();
        let mut covariance = Matrix::from_fn(d, d, |i, j| present * before[(i, j)]);
        for spread in spreads {
            spread.add_to(&mut covariance, own);
        }
        if let Some(metric) = Self::of(shape, &covariance) {
            *self = metric;
        }
    }
}

/// Moments of the draws of one chain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) enum Spread {
    /// Number of draws, their mean, and the sums of squared deviations from it.
    Diagonal(u64, Vec<f64>, Vec<f64>),
    /// Full covariance.
    Dense(Moments),
}

impl Spread {
    /// Returns moments without any draw.
    pub fn new(shape: Shape, dimension: usize) -> Self {
        match shape {
            Shape::Diagonal => Self::Diagonal(0, vec![0.0; dimension], vec![0.0; dimension]),
            Shape::Dense => Self::Dense(Moments::new(dimension)),
        }
    }

    /// Adds one draw.
    pub fn add(&mut self, place: &[f64]) {
        match self {
            Self::Dense(moments) => moments.add(place),
            Self::Diagonal(count, mean, squares) => {
                *count += 1;
                for ((x, mean), sum) in place.iter().zip(mean).zip(squares) {
                    let before = x - *mean;
                    *mean += before / *count as f64;
                    *sum += before * (x - *mean);
                }
            }
        }
    }

    fn dimension(&self) -> usize {
        match self {
            Self::Dense(moments) => moments.mean().len(),
            Self::Diagonal(_, mean, _) => mean.len(),
        }
    }

    /// Returns the degrees of freedom: the number of draws minus one.
    fn degrees(&self) -> f64 {
        let count = match self {
            Self::Dense(moments) => moments.count(),
            Self::Diagonal(count, ..) => *count,
        };
        count.saturating_sub(1) as f64
    }

    /// Adds the sums of products of deviations, multiplied by `factor`, to `sums`.
    fn add_to(&self, sums: &mut Matrix, factor: f64) {
        match self {
            Self::Dense(moments) => {
                let covariance = moments.covariance();
                let factor = factor * self.degrees();
                for (sum, entry) in sums.as_mut_slice().iter_mut().zip(covariance.as_slice()) {
                    *sum += factor * entry;
                }
            }
            Self::Diagonal(_, _, squares) => {
                for (j, square) in squares.iter().enumerate() {
                    sums[(j, j)] += factor * square;
                }
            }
        }
    }
}
