//! Forward maps that count their evaluations: the progress of a search, whose end is not known beforehand.

use lacuna::plugin::Forward;
use lacuna::plugin::forward::{Linear, Wanted};
use lacuna::run::Progress;
use lacuna_linalg::Matrix;

use crate::gap::experiment::wider::ExtendedMap;

/// The extended map, whose evaluations are counted.
pub fn counted<'a>(map: ExtendedMap<'a>, progress: &'a Progress<'a>) -> ExtendedMap<'a> {
    ExtendedMap { forward: Box::new(Counted { forward: map.forward, progress }), ..map }
}

/// A forward map whose evaluations are counted; with the derivatives an evaluation counts once.
pub struct Counted<'a, F> {
    forward: F,
    progress: &'a Progress<'a>,
}

impl<'a, F> Counted<'a, F> {
    /// A forward map whose evaluations are added to `progress`.
    pub fn new(forward: F, progress: &'a Progress<'a>) -> Self {
        Self { forward, progress }
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
        self.progress.add(points.rows() as u64);
        self.forward.mean(points)
    }

    fn variance(&self, points: &Matrix) -> Option<Matrix> {
        self.forward.variance(points)
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        self.progress.add(1);
        self.forward.jacobian(point)
    }

    fn mean_and_jacobian(&self, point: &[f64]) -> (Vec<f64>, Matrix) {
        self.progress.add(1);
        self.forward.mean_and_jacobian(point)
    }

    fn mean_and_jacobian_by(&self, point: &[f64], wanted: Wanted<'_>) -> (Vec<f64>, Matrix) {
        self.progress.add(1);
        self.forward.mean_and_jacobian_by(point, wanted)
    }

    fn mean_at(&self, needed: &[bool], points: &Matrix) -> Matrix {
        self.progress.add(points.rows() as u64);
        self.forward.mean_at(needed, points)
    }

    fn linear(&self) -> Option<&dyn Linear> {
        self.forward.linear()
    }

    fn failure(&self) -> Option<String> {
        self.forward.failure()
    }
}
