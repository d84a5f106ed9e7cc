//! Surrogates: from runs to an emulator that knows its own error.

use serde::{Deserialize, Serialize};

use super::{Component, Fact};
use crate::data::{Layout, Parameter};
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::run::{Progress, Stop};

/// Fits an emulator to simulation runs.
pub trait Surrogate: Component {
    /// Fits an emulator to all outputs.
    fn fit(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Box<dyn Emulator>, Stop>;

    /// An emulator from what [`Emulator::save`] wrote.
    fn load(&self, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop>;
}

/// The runs to which a surrogate is fitted.
#[derive(Debug, Clone, Copy)]
pub struct Training<'a> {
    /// The parameters with their design distributions.
    pub parameters: &'a [Parameter],
    /// The shape of a response.
    pub layout: &'a Layout,
    /// The parameters of each run in physical units, `runs x parameters`.
    pub points: &'a Matrix,
    /// The responses, `runs x outputs`.
    pub responses: &'a Matrix,
}

/// A fitted surrogate. Points are in physical units, one a row.
pub trait Emulator: Send + Sync {
    /// The number of parameters.
    fn dimension(&self) -> usize;

    /// The number of outputs.
    fn outputs(&self) -> usize;

    /// The emulated responses, `points x outputs`.
    fn mean(&self, points: &Matrix) -> Matrix;

    /// The emulator's own variance at each point and output, where the method knows one.
    fn variance(&self, _points: &Matrix) -> Option<Matrix> {
        None
    }

    /// The derivative of each output (rows) by each parameter (columns) at a point.
    fn jacobian(&self, point: &[f64]) -> Matrix;

    /// The emulator as a linear combination of basis functions, where it is one.
    fn linear(&self) -> Option<&dyn Linear> {
        None
    }

    /// Which parameters matter under the design's distribution, where the method knows it exactly.
    fn sensitivity(&self) -> Option<Sensitivity> {
        None
    }

    /// How well it fits, judged on its own training runs.
    fn fit_error(&self) -> &FitError;

    /// What is worth telling about the fit.
    fn facts(&self) -> Vec<Fact>;

    /// The emulator as bytes, for [`Surrogate::load`].
    fn save(&self) -> Result<Vec<u8>, Stop>;
}

/// An emulator `y(x) = C' psi(x)` with coefficients `C` (`terms x outputs`).
pub trait Linear: Send + Sync {
    /// The coefficients, `terms x outputs`.
    fn coefficients(&self) -> &Matrix;

    /// The basis functions at each point, `points x terms`.
    fn basis(&self, points: &Matrix) -> Matrix;

    /// The derivative of each basis function (rows) by each parameter (columns) at a point.
    fn basis_gradient(&self, point: &[f64]) -> Matrix;

    /// The sum of squares `|R (psi(x), 1)|^2` as a function of the point, for a factor `R` (`any x (terms +
    /// 1)`), where the basis has a form of it that takes fewer operations than the product.
    fn sum_of_squares(&self, _factor: &Matrix) -> Option<Box<dyn SumOfSquares>> {
        None
    }
}

/// A sum of squares of linear combinations of basis functions.
pub trait SumOfSquares: Send + Sync {
    /// The sum at each point (one a row, in physical units) that it [covers](Self::covers).
    fn values(&self, points: &Matrix) -> Vec<f64>;

    /// Whether the form holds at a point to its [error](Self::error).
    fn covers(&self, point: &[f64]) -> bool;

    /// The largest difference from the product's own sum of squares that round-off makes.
    ///
    /// A sum of squares that is expanded carries the round-off of its largest parts into its
    /// smallest values; whoever uses it compares this number with what matters.
    fn error(&self) -> f64;
}

/// The error of a fit estimated from its own training runs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FitError {
    /// The leave-one-out error of each output relative to the output's variance over the runs
    /// (corrected for the selection of terms where the method does so).
    pub relative: Vec<f64>,
    /// The leave-one-out residual of each run and output, `runs x outputs`, in the response's unit.
    pub residuals: Matrix,
}

/// The moments of each output under the design's distribution and Sobol' indices: shares of its
/// variance. An output without variance has zero indices.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Sensitivity {
    /// The mean of each output.
    pub mean: Vec<f64>,
    /// The variance of each output.
    pub variance: Vec<f64>,
    /// The pairs of parameters to which the columns of [`Indices::pairs`] belong.
    pub pairs: Vec<[usize; 2]>,
    /// The indices of each output, one a row.
    pub outputs: Indices,
    /// The indices of all outputs together, weighted by their variances: one row (Gamboa, Janon,
    /// Klein and Lagnoux 2014).
    pub aggregated: Indices,
}

/// Sobol' indices, one row an output.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Indices {
    /// The share due to each parameter alone, `outputs x parameters`.
    pub first: Matrix,
    /// The share in which each parameter takes part, `outputs x parameters`.
    pub total: Matrix,
    /// The share due to each pair's interaction beyond the first-order shares, `outputs x pairs`.
    pub pairs: Matrix,
}
