//! A limit state that counts its calls.

use std::cell::Cell;

use lacuna::plugin::reliability::LimitState;
use lacuna::run::{Progress, Stop};
use lacuna_linalg::Matrix;

/// A limit state with the number of calls, of those without an answer, and of failures.
pub struct Counted<'a> {
    state: &'a dyn LimitState,
    progress: &'a Progress<'a>,
    calls: Cell<usize>,
    undefined: Cell<usize>,
    failures: Cell<usize>,
}

impl<'a> Counted<'a> {
    /// Counts from zero.
    pub fn new(state: &'a dyn LimitState, progress: &'a Progress<'a>) -> Self {
        let zero = || Cell::new(0);
        Self { state, progress, calls: zero(), undefined: zero(), failures: zero() }
    }

    /// Number of variables.
    pub fn dimension(&self) -> usize {
        self.state.dimension()
    }

    /// Values at the rows of `points`; NaN where there is no answer.
    pub fn values(&self, points: &Matrix) -> Result<Vec<f64>, Stop> {
        let values = self.state.values(points)?;
        let count = |kept: fn(&f64) -> bool| values.iter().filter(|&value| kept(value)).count();
        self.calls.set(self.calls.get() + values.len());
        self.undefined.set(self.undefined.get() + count(|value| value.is_nan()));
        self.failures.set(self.failures.get() + count(|value| *value <= 0.0));
        self.progress.add(values.len() as u64);
        Ok(values)
    }

    /// Values at the rows of `points`; infinity, which is no failure, where there is no answer.
    pub fn answers(&self, points: &Matrix) -> Result<Vec<f64>, Stop> {
        let values = self.values(points)?;
        Ok(values.into_iter().map(|v| if v.is_nan() { f64::INFINITY } else { v }).collect())
    }

    /// Value at one point.
    pub fn value(&self, point: &[f64]) -> Result<f64, Stop> {
        let values = self.values(&Matrix::from_vec(1, point.len(), point.to_vec()))?;
        Ok(values.first().copied().unwrap_or(f64::NAN))
    }

    /// Number of calls so far.
    pub fn calls(&self) -> usize {
        self.calls.get()
    }

    /// Number of calls without an answer.
    pub fn undefined(&self) -> usize {
        self.undefined.get()
    }

    /// Number of calls at which the limit was exceeded.
    pub fn failures(&self) -> usize {
        self.failures.get()
    }

    /// Warning on calls without an answer, if there are some.
    pub fn warning(&self) -> Option<String> {
        let (undefined, calls) = (self.undefined(), self.calls());
        (undefined > 0).then(|| {
            format!(
                "the model gave no answer at {undefined} of {calls} calls; they count as no failure"
            )
        })
    }
}
