//! The compressed likelihoods of libraries' discrepancies.

use super::{Slopes, slopes};
use crate::linalg::{Matrix, transposed_multiply_vector};
use crate::plugin::abi::Refusal;
use crate::plugin::abi::host::object::Object;
use crate::plugin::abi::host::plugin::optional;
use crate::plugin::abi::linear::ServedLinear;
use crate::plugin::abi::table::{CompressedFunctions, Numbers};
use crate::plugin::discrepancy::Compressed;
use crate::plugin::forward::Linear;

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
        let (ask, this) = (self.object.functions.log_likelihood, self.object.this);
        let (at, given) = (Numbers::of(basis), Numbers::of(hyper));
        let values = self.object.densities("log_likelihood", basis.rows(), |to, a| {
            // SAFETY: the function belongs to the likelihood; the buffer holds one number a point.
            optional(ask, |f| unsafe { f(this, at, given, to, a) })
        });
        self.densities(values, basis.rows())
    }

    fn log_likelihood_at(&self, linear: &dyn Linear, points: &Matrix, hyper: &Matrix) -> Vec<f64> {
        let Some(ask) = self.object.functions.log_likelihood_at else {
            return self.log_likelihood(&linear.basis(points), hyper);
        };
        let served = ServedLinear::new(linear);
        let (map, this) = (served.table(), self.object.this);
        let (at, given) = (Numbers::of(points), Numbers::of(hyper));
        let values = self.object.densities("log_likelihood_at", points.rows(), |to, a| {
            // SAFETY: the function belongs to the likelihood; the buffer holds one number a point, and the map is there
            // until it returns.
            unsafe { ask(this, &raw const map, at, given, to, a) }
        });
        self.densities(values, points.rows())
    }

    fn gradient(&self, basis: &[f64], hyper: &[f64]) -> Slopes {
        let (ask, this) = (self.object.functions.gradient, self.object.this);
        let (at, given) = (Numbers::row(basis), Numbers::row(hyper));
        let call = |to, beside, a| {
            // SAFETY: the function belongs to the likelihood; the buffers hold one number a term and an unknown.
            optional(ask, |f| unsafe { f(this, at, given, to, beside, a) })
        };
        let row = |x: &[f64]| Matrix::from_vec(1, x.len(), x.to_vec());
        let density = || self.log_likelihood(&row(basis), &row(hyper))[0];
        slopes(&self.object, (basis.len(), hyper.len()), call, density)
    }

    fn gradient_at(&self, linear: &dyn Linear, point: &[f64], hyper: &[f64]) -> Slopes {
        let Some(ask) = self.object.functions.gradient_at else {
            let basis = linear.basis(&Matrix::from_rows(point.len(), [point]));
            let (by_basis, by_hyper) = self.gradient(basis.row(0), hyper);
            return (
                transposed_multiply_vector(&linear.basis_gradient(point), &by_basis),
                by_hyper,
            );
        };
        let served = ServedLinear::new(linear);
        let (map, this) = (served.table(), self.object.this);
        let (at, given) = (Numbers::row(point), Numbers::row(hyper));
        let call = |to, beside, a| {
            // SAFETY: as in `log_likelihood_at`, with one number a parameter and an unknown.
            unsafe { ask(this, &raw const map, at, given, to, beside, a) }
        };
        let row = |x: &[f64]| Matrix::from_vec(1, x.len(), x.to_vec());
        let density = || self.log_likelihood_at(linear, &row(point), &row(hyper))[0];
        slopes(&self.object, (point.len(), hyper.len()), call, density)
    }
}
