//! The log density of the program, as samplers of a library see it.

use std::sync::Arc;

use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::plugin::Target;
use crate::plugin::abi::table::{self, Answer, Key, Numbers, Table as _, TargetFunctions, status};
use crate::plugin::abi::{Refusal, Reply};
use crate::plugin::fault::Fault;

/// A density that the program computes. Without an answer the density has a fault and is minus infinity.
pub struct TargetView<'a> {
    target: &'a table::Target,
    functions: &'a TargetFunctions,
    fault: Arc<Fault>,
}

// SAFETY: the functions of a table may be called from any thread, and the target is there during `'a`.
unsafe impl Sync for TargetView<'_> {}

impl<'a> TargetView<'a> {
    /// A view of a density.
    ///
    /// # Safety
    /// All that the struct points to is there during `'a`.
    pub unsafe fn new(target: &'a table::Target) -> Result<Self, Refusal> {
        // SAFETY: as the caller promises.
        let functions = unsafe { target.functions.as_ref() }.filter(|f| f.missing().is_none());
        let functions =
            functions.ok_or_else(|| Refusal::stop("the density cannot be asked for"))?;
        Ok(Self { target, functions, fault: Arc::new(Fault::new("the program")) })
    }

    /// What went wrong in what was asked.
    pub fn sound(&self) -> Result<(), Refusal> {
        self.fault.said().map_or(Ok(()), |said| Err(Refusal::stop(said)))
    }

    fn ask(&self, what: &'static str, call: impl FnOnce(*const Answer) -> i32) {
        if let Err(refusal) = Reply::of(what, call) {
            self.fault.report(refusal.message);
        }
    }
}

impl Target for TargetView<'_> {
    fn dimension(&self) -> usize {
        self.target.dimension
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        let mut values = vec![f64::NEG_INFINITY; points.rows()];
        let (ask, to) = (self.functions.log_density, values.as_mut_ptr());
        self.ask("log_density", |answer| {
            // SAFETY: the buffer holds one number a point.
            ask.map_or(status::ABSENT, |f| unsafe {
                f(self.target.target, Numbers::of(points), to, answer)
            })
        });
        values
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        let mut values = vec![f64::NEG_INFINITY; points.rows()];
        let (ask, to) = (self.functions.log_prior, values.as_mut_ptr());
        self.ask("log_prior", |answer| {
            // SAFETY: the buffer holds one number a point.
            ask.map_or(status::ABSENT, |f| unsafe {
                f(self.target.target, Numbers::of(points), to, answer)
            })
        });
        values
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let (mut value, mut gradient) = (f64::NEG_INFINITY, vec![0.0; point.len()]);
        let ask = self.functions.gradient;
        let (to, slopes) = (&raw mut value, gradient.as_mut_ptr());
        self.ask("gradient", |answer| {
            // SAFETY: the buffers hold one number, and one a coordinate.
            ask.map_or(status::ABSENT, |f| unsafe {
                f(self.target.target, Numbers::row(point), to, slopes, answer)
            })
        });
        (value, gradient)
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        let (mut low, mut high) =
            (vec![f64::NEG_INFINITY; self.dimension()], vec![f64::INFINITY; self.dimension()]);
        let (ask, from, to) = (self.functions.bounds, low.as_mut_ptr(), high.as_mut_ptr());
        self.ask("bounds", |answer| {
            // SAFETY: the buffers hold one number a coordinate.
            ask.map_or(status::ABSENT, |f| unsafe { f(self.target.target, from, to, answer) })
        });
        low.into_iter().zip(high).collect()
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut points = Matrix::zeros(count, self.dimension());
        let (ask, to) = (self.functions.prior_draws, points.as_mut_slice().as_mut_ptr());
        let key = Key { words: stream.key() };
        self.ask("prior_draws", |answer| {
            // SAFETY: the buffer holds `count x dimension` numbers.
            ask.map_or(status::ABSENT, |f| unsafe { f(self.target.target, count, key, to, answer) })
        });
        points
    }

    fn failure(&self) -> Option<String> {
        let ask = self.functions.failure;
        // SAFETY: the function belongs to the target.
        let call =
            |answer| ask.map_or(status::ABSENT, |f| unsafe { f(self.target.target, answer) });
        match Reply::of("failure", call) {
            Ok(reply) => Some(reply.string()),
            Err(refusal) if refusal.status == status::ABSENT => None,
            Err(refusal) => Some(refusal.message),
        }
    }
}
