//! Forward map of a calibration: from a study's parameters to the responses that are compared with data.

use lacuna_base::matrix::Matrix;

/// Map from parameters to responses: a fitted surrogate, or the model itself. Points are in physical units, one per
/// row.
pub trait Forward: Send + Sync {
    /// Number of parameters.
    fn dimension(&self) -> usize;

    /// Number of outputs.
    fn outputs(&self) -> usize;

    /// Responses, `points x outputs`; a row of NaN where the map has no answer. A surrogate returns its mean.
    fn mean(&self, points: &Matrix) -> Matrix;

    /// Variance of the map itself at each point and output (`points x outputs`), if known.
    fn variance(&self, _points: &Matrix) -> Option<Matrix> {
        None
    }

    /// Derivative of each output by each parameter at a point, `outputs x parameters`.
    fn jacobian(&self, point: &[f64]) -> Matrix;

    /// The response at a point as [`Forward::mean`] returns it, and its [`Forward::jacobian`], to the map's own
    /// accuracy.
    fn mean_and_jacobian(&self, point: &[f64]) -> (Vec<f64>, Matrix) {
        let mean = self.mean(&Matrix::from_vec(1, point.len(), point.to_vec()));
        (mean.into_vec(), self.jacobian(point))
    }

    /// Like [`Forward::mean_and_jacobian`], but with the wanted derivatives only.
    fn mean_and_jacobian_by(&self, point: &[f64], wanted: Wanted<'_>) -> (Vec<f64>, Matrix) {
        let (mean, jacobian) = self.mean_and_jacobian(point);
        (mean, jacobian.select_columns(wanted.parameters))
    }

    /// Like [`Forward::mean`], where only some of the outputs are needed; the others may be any finite numbers.
    fn mean_at(&self, _needed: &[bool], points: &Matrix) -> Matrix {
        self.mean(points)
    }

    /// Returns true if the response of the same point is another one with other random numbers.
    fn is_stochastic(&self) -> bool {
        false
    }

    /// Responses of several runs at each point, the runs of a point together: `(points x count) x outputs`; a row of NaN
    /// where a run has no answer. Runs of a point differ in their random numbers only; those of a map that is not
    /// [stochastic](Self::is_stochastic) are equal.
    fn runs(&self, points: &Matrix, count: usize, _numbers: Numbers) -> Matrix {
        let mean = self.mean(points);
        let rows = mean.iter_rows().flat_map(|row| std::iter::repeat_n(row, count));
        Matrix::from_rows(self.outputs(), rows)
    }

    /// The map as a linear combination of basis functions, if it has that form.
    fn linear(&self) -> Option<&dyn Linear> {
        None
    }

    /// Reason why the map can no longer answer; `None` while it works.
    fn failure(&self) -> Option<String> {
        None
    }
}

/// Derivatives that are wanted of a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wanted<'a> {
    /// Parameters by which the derivatives are wanted, in this order.
    pub parameters: &'a [usize],
    /// True for each output that is needed, as in [`Forward::mean_at`]; `None` for all.
    pub outputs: Option<&'a [bool]>,
}

impl<'a> Wanted<'a> {
    /// The derivatives of all outputs by these parameters.
    pub fn by(parameters: &'a [usize]) -> Self {
        Self { parameters, outputs: None }
    }
}

/// Random numbers of the runs of a stochastic map. The first run of a point with its own numbers is [`Forward::mean`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Numbers {
    /// Other numbers at every point, which the point determines to the last bit: a point that is evaluated again has the
    /// same response.
    OfPoint,
    /// The same numbers at every point: the set with this index.
    Common(u64),
}

/// A forward map `y(x) = C' psi(x)` with coefficients `C` (`terms x outputs`).
pub trait Linear: Send + Sync {
    /// Coefficients, `terms x outputs`.
    fn coefficients(&self) -> &Matrix;

    /// Basis functions at each point, `points x terms`.
    fn basis(&self, points: &Matrix) -> Matrix;

    /// Derivative of each basis function by each parameter at a point, `terms x parameters`.
    fn basis_gradient(&self, point: &[f64]) -> Matrix;

    /// The sum of squares `|R (psi(x), 1)|^2` as a function of the point, for a factor `R` (`any x (terms + 1)`), if
    /// the basis has a form of it that is cheaper than the product.
    fn sum_of_squares(&self, _factor: &Matrix) -> Option<Box<dyn SumOfSquares>> {
        None
    }
}

/// A sum of squares of linear combinations of basis functions.
pub trait SumOfSquares: Send + Sync {
    /// The sum of squares at each point, in physical units and one per row; the points must be [covered](Self::covers).
    fn values(&self, points: &Matrix) -> Vec<f64>;

    /// Derivative by each parameter at a point that is covered.
    fn gradient(&self, point: &[f64]) -> Vec<f64>;

    /// Returns true if the form is valid at a point to within its [error](Self::error).
    fn covers(&self, point: &[f64]) -> bool;

    /// Returns true if the form is valid at all of these points.
    fn covers_all(&self, points: &Matrix) -> bool {
        points.iter_rows().all(|point| self.covers(point))
    }

    /// Largest difference from the direct product that round-off can cause.
    ///
    /// An expanded sum of squares carries the round-off of its largest terms into its smallest values; the caller
    /// compares this number with the accuracy it needs.
    fn error(&self) -> f64;
}
