//! The forward map of a calibration: from a study's parameters to the responses that data are compared with.

use crate::linalg::Matrix;

/// From parameters to responses: a fitted surrogate, or the model itself. Points are in physical units,
/// one a row.
pub trait Forward: Send + Sync {
    /// The number of parameters.
    fn dimension(&self) -> usize;

    /// The number of outputs.
    fn outputs(&self) -> usize;

    /// The responses, `points x outputs`; a row of NaN where there is none. A surrogate's are its means.
    fn mean(&self, points: &Matrix) -> Matrix;

    /// The map's own variance at each point and output, where it knows one.
    fn variance(&self, _points: &Matrix) -> Option<Matrix> {
        None
    }

    /// The derivative of each output (rows) by each parameter (columns) at a point.
    fn jacobian(&self, point: &[f64]) -> Matrix;

    /// The response at a point as [`Forward::mean`] gives it, and its [`Forward::jacobian`], to the map's own accuracy.
    fn mean_and_jacobian(&self, point: &[f64]) -> (Vec<f64>, Matrix) {
        let mean = self.mean(&Matrix::from_vec(1, point.len(), point.to_vec()));
        (mean.into_vec(), self.jacobian(point))
    }

    /// The same with the derivatives by these parameters alone, in this order.
    fn mean_and_jacobian_by(&self, point: &[f64], parameters: &[usize]) -> (Vec<f64>, Matrix) {
        let (mean, jacobian) = self.mean_and_jacobian(point);
        (mean, jacobian.select_columns(parameters))
    }

    /// The map as a linear combination of basis functions, where it is one.
    fn linear(&self) -> Option<&dyn Linear> {
        None
    }

    /// Why the map can answer no more, once that has happened.
    fn failure(&self) -> Option<String> {
        None
    }
}

/// A forward map `y(x) = C' psi(x)` with coefficients `C` (`terms x outputs`).
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

    /// The derivative by each parameter at a point that it covers.
    fn gradient(&self, point: &[f64]) -> Vec<f64>;

    /// Whether the form holds at a point to its [error](Self::error).
    fn covers(&self, point: &[f64]) -> bool;

    /// Whether it holds at all of these points.
    fn covers_all(&self, points: &Matrix) -> bool {
        points.iter_rows().all(|point| self.covers(point))
    }

    /// The largest difference from the product's own sum of squares that round-off makes.
    ///
    /// A sum of squares that is expanded carries the round-off of its largest parts into its
    /// smallest values; whoever uses it compares this number with what matters.
    fn error(&self) -> f64;
}
