//! Forward maps that count their evaluations: the progress of a search, whose end is not known beforehand.

use std::sync::atomic::{AtomicU64, Ordering};

use lacuna::plugin::Forward;
use lacuna::plugin::forward::Linear;
use lacuna::run::Observer;
use lacuna_linalg::Matrix;

use crate::gap::experiment::wider::ExtendedMap;

/// The number of evaluations so far, and the observer that is told.
pub struct Counter<'a> {
    observer: &'a dyn Observer,
    count: AtomicU64,
}

impl<'a> Counter<'a> {
    /// A counter of no evaluation.
    pub fn new(observer: &'a dyn Observer) -> Self {
        Self { observer, count: AtomicU64::new(0) }
    }

    fn add(&self, evaluations: usize) {
        let further = evaluations as u64;
        let done = self.count.fetch_add(further, Ordering::Relaxed) + further;
        self.observer.advance(done);
    }

    /// The extended map, whose evaluations are counted.
    pub fn over<'b>(&'b self, map: ExtendedMap<'b>) -> ExtendedMap<'b> {
        let forward = Box::new(Counted { forward: map.forward, counter: self });
        ExtendedMap { forward, ..map }
    }
}

/// A forward map whose evaluations are counted; with the derivatives an evaluation counts once.
pub struct Counted<'a, F> {
    forward: F,
    counter: &'a Counter<'a>,
}

impl<'a, F> Counted<'a, F> {
    /// A forward map with the counter of its evaluations.
    pub fn new(forward: F, counter: &'a Counter<'a>) -> Self {
        Self { forward, counter }
    }
}

impl<F: std::ops::Deref<Target: Forward> + Send + Sync> Forward for Counted<'_, F> {
    fn dimension(&self) -> usize {
        self.forward.dimension()
    }

    fn outputs(&self) -> usize {
        self.forward.outputs()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        self.counter.add(points.rows());
        self.forward.mean(points)
    }

    fn variance(&self, points: &Matrix) -> Option<Matrix> {
        self.forward.variance(points)
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        self.counter.add(1);
        self.forward.jacobian(point)
    }

    fn mean_and_jacobian(&self, point: &[f64]) -> (Vec<f64>, Matrix) {
        self.counter.add(1);
        self.forward.mean_and_jacobian(point)
    }

    fn mean_and_jacobian_by(&self, point: &[f64], parameters: &[usize]) -> (Vec<f64>, Matrix) {
        self.counter.add(1);
        self.forward.mean_and_jacobian_by(point, parameters)
    }

    fn linear(&self) -> Option<&dyn Linear> {
        self.forward.linear()
    }

    fn failure(&self) -> Option<String> {
        self.forward.failure()
    }
}
