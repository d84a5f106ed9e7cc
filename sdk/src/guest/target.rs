//! The log density of the program, as samplers of a library see it.

use std::marker::PhantomData;
use std::sync::Arc;

use lacuna::math::random::Stream;
use lacuna::matrix::Matrix;
use lacuna::plugin::Target;
use lacuna::run::fault::Fault;
use lacuna_abi::object::Asked;
use lacuna_abi::table::{self, TargetFunctions, copied};
use lacuna_abi::{Object, Refusal};

/// A density that the program computes. Without an answer the density has a fault and is minus infinity.
pub struct TargetView<'a> {
    target: Object<TargetFunctions>,
    dimension: usize,
    /// The time for which the density is there.
    during: PhantomData<&'a ()>,
}

impl<'a> TargetView<'a> {
    /// A view of a density.
    ///
    /// # Safety
    /// All that the struct points to is there during `'a`.
    pub unsafe fn new(target: &'a table::Target) -> Result<Self, Refusal> {
        // SAFETY: as the caller promises.
        let functions = unsafe { copied(target.functions) }
            .map_err(|_| Refusal::stop("the density cannot be asked for"))?;
        let fault = Arc::new(Fault::new("the program"));
        let dimension = target.dimension;
        let target = Object::new(target.target, functions, None, fault);
        Ok(Self { target, dimension, during: PhantomData })
    }

    /// An error where the program failed to answer.
    pub fn sound(&self) -> Result<(), Refusal> {
        self.target.fault().said().map_or(Ok(()), |said| Err(Refusal::stop(said)))
    }

    /// A call that fills a buffer; what it does not fill stays as it is.
    fn ask(&self, asked: Asked) {
        self.target.or_fault(asked.demand_plain().map(|_| ()), || ());
    }
}

impl Target for TargetView<'_> {
    fn dimension(&self) -> usize {
        self.dimension
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        let mut values = vec![f64::NEG_INFINITY; points.rows()];
        // SAFETY: the buffer holds one number a point.
        self.ask(unsafe { self.target.log_density(points, values.as_mut_ptr()) });
        values
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        let mut values = vec![f64::NEG_INFINITY; points.rows()];
        // SAFETY: the buffer holds one number a point.
        self.ask(unsafe { self.target.log_prior(points, values.as_mut_ptr()) });
        values
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let (mut value, mut gradient) = (f64::NEG_INFINITY, vec![0.0; point.len()]);
        // SAFETY: the buffers hold one number, and one a coordinate.
        self.ask(unsafe { self.target.gradient(point, &raw mut value, gradient.as_mut_ptr()) });
        (value, gradient)
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        let (mut low, mut high) =
            (vec![f64::NEG_INFINITY; self.dimension], vec![f64::INFINITY; self.dimension]);
        // SAFETY: the buffers hold one number a coordinate.
        self.ask(unsafe { self.target.bounds(low.as_mut_ptr(), high.as_mut_ptr()) });
        low.into_iter().zip(high).collect()
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut points = Matrix::zeros(count, self.dimension);
        let to = points.as_mut_slice().as_mut_ptr();
        // SAFETY: the buffer holds `count x dimension` numbers.
        self.ask(unsafe { self.target.prior_draws(count, stream, to) });
        points
    }

    fn failure(&self) -> Option<String> {
        // SAFETY: nothing is written.
        match unsafe { self.target.failure() }.if_any() {
            Ok(reply) => reply.map(|reply| reply.string()),
            Err(refusal) => Some(refusal.message),
        }
    }
}
