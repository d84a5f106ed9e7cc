//! The compressed likelihoods of libraries' discrepancies.

use lacuna::plugin::discrepancy::Compressed;
use lacuna::plugin::forward::Linear;
use lacuna_abi::linear::ServedLinear;
use lacuna_abi::object::densities;
use lacuna_abi::table::CompressedFunctions;
use lacuna_abi::{Object, Refusal};
use lacuna_linalg::{Matrix, transposed_multiply_vector};

use super::{Slopes, slopes};

/// A compressed likelihood that a library computes.
pub(super) struct LoadedCompressed {
    object: Object<CompressedFunctions>,
}

impl LoadedCompressed {
    pub fn new(object: Object<CompressedFunctions>) -> Self {
        Self { object }
    }

    fn densities(&self, values: Result<Vec<f64>, Refusal>, count: usize) -> Vec<f64> {
        self.object.or_fault(values, || vec![f64::NEG_INFINITY; count])
    }
}

impl Compressed for LoadedCompressed {
    fn log_likelihood(&self, basis: &Matrix, hyper: &Matrix) -> Vec<f64> {
        // SAFETY: the buffer holds one number a point.
        let call = |to| unsafe { self.object.log_likelihood(basis, hyper, to) };
        let values = densities(basis.rows(), call);
        self.densities(values, basis.rows())
    }

    fn log_likelihood_at(&self, linear: &dyn Linear, points: &Matrix, hyper: &Matrix) -> Vec<f64> {
        if self.object.functions.log_likelihood_at.is_none() {
            return self.log_likelihood(&linear.basis(points), hyper);
        }
        let served = ServedLinear::new(linear);
        let map = served.table();
        let call = |to| {
            // SAFETY: the buffer holds one number a point, and the map is there until the call returns.
            unsafe { self.object.log_likelihood_at(&raw const map, points, hyper, to) }
        };
        let values = densities(points.rows(), call);
        self.densities(values, points.rows())
    }

    fn gradient(&self, basis: &[f64], hyper: &[f64]) -> Slopes {
        // SAFETY: the buffers hold one number a term and an unknown.
        let call = |to, beside| unsafe { self.object.gradient(basis, hyper, to, beside) };
        let row = |x: &[f64]| Matrix::from_vec(1, x.len(), x.to_vec());
        let density = || self.log_likelihood(&row(basis), &row(hyper))[0];
        slopes(&self.object, (basis.len(), hyper.len()), call, density)
    }

    fn gradient_at(&self, linear: &dyn Linear, point: &[f64], hyper: &[f64]) -> Slopes {
        if self.object.functions.gradient_at.is_none() {
            let basis = linear.basis(&Matrix::from_rows(point.len(), [point]));
            let (by_basis, by_hyper) = self.gradient(basis.row(0), hyper);
            return (
                transposed_multiply_vector(&linear.basis_gradient(point), &by_basis),
                by_hyper,
            );
        }
        let served = ServedLinear::new(linear);
        let map = served.table();
        let call = |to, beside| {
            // SAFETY: as in `log_likelihood_at`, with one number a parameter and an unknown.
            unsafe { self.object.gradient_at(&raw const map, point, hyper, to, beside) }
        };
        let row = |x: &[f64]| Matrix::from_vec(1, x.len(), x.to_vec());
        let density = || self.log_likelihood_at(linear, &row(point), &row(hyper))[0];
        slopes(&self.object, (point.len(), hyper.len()), call, density)
    }
}
