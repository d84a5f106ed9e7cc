//! Common errors by the weights of their leading directions.

use lacuna::data::Unit;
use lacuna::linalg::{self, Matrix};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::discrepancy::{CommonError, Hyperparameter};
use lacuna::run::Stop;

use super::Directions;
use crate::discrepancies::common::Replicates;

/// A common error `F zeta` with `zeta` standard normal, of which the leading directions are kept:
/// with the singular value decomposition `W F = U diag(s) V'`, `W` the roots of the counts, it is
/// `F V` times as many standard normal numbers, the first of which matter most to the mean curve.
#[derive(Debug, Clone)]
pub(super) struct Latent {
    pub origin: String,
    pub predictive: bool,
    /// The kept columns of `F V`, one a row, over all outputs.
    pub directions: Matrix,
    /// The position of the first weight among the hyperparameters.
    first: usize,
    /// The share of the variance of the mean curve that is kept.
    pub share: f64,
}

impl Latent {
    /// The leading directions of an error; their weights are added to the hyperparameters.
    pub fn new(
        error: &CommonError,
        replicates: &Replicates,
        limit: Directions,
        hyper: &mut Vec<Hyperparameter>,
    ) -> Result<Self, Stop> {
        let (rows, columns) = (replicates.measured.len(), error.factor.columns());
        let weighted = Matrix::from_fn(rows, columns, |k, j| {
            replicates.count[k].sqrt() * error.factor[(replicates.measured[k], j)]
        });
        let svd = linalg::thin_svd(&weighted)
            .map_err(|e| Stop::new(format!("the covariance of the common errors: {e}")))?;
        let squares: Vec<f64> = svd.values.iter().map(|s| s * s).collect();
        let total: f64 = squares.iter().sum();
        let (mut kept, mut carried) = (0, 0.0);
        while kept < squares.len().min(limit.most)
            && carried < limit.share * total
            && squares[kept] > 1e-24 * squares[0]
        {
            carried += squares[kept];
            kept += 1;
        }
        let turn = svd.v.select_columns(&(0..kept).collect::<Vec<_>>());
        let first = hyper.len();
        hyper.extend((1..=kept).map(|k| Hyperparameter {
            name: format!("{}[{k}]", error.origin),
            symbol: format!("{}[{k}]", error.origin),
            unit: Unit::dimensionless(),
            prior: Distribution::Normal([0.0, 1.0]),
            log: false,
            start: 0.0,
        }));
        Ok(Self {
            origin: error.origin.clone(),
            predictive: error.predictive,
            directions: linalg::multiply(&error.factor, &turn).transposed(),
            first,
            share: if total > 0.0 { carried / total } else { 1.0 },
        })
    }

    fn range(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.directions.rows()
    }

    /// The error at each output.
    pub fn error(&self, hyper: &[f64]) -> Vec<f64> {
        linalg::transposed_multiply_vector(&self.directions, &hyper[self.range()])
    }

    /// Adds the derivatives by the weights, given those by the outputs.
    pub fn add_gradient(&self, by_output: &[f64], by_hyper: &mut [f64]) {
        let by_weight = linalg::multiply_vector(&self.directions, by_output);
        let own = &mut by_hyper[self.range()];
        own.iter_mut().zip(by_weight).for_each(|(sum, g)| *sum += g);
    }
}
