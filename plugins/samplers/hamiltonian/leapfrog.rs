//! Motion over the landscape of a log density.
//!
//! With the covariance `F F'` as the inverse of the mass matrix, a momentum `p` is kept as `z = F' p`, which is
//! standard normal: the kinetic energy is `z'z / 2` and the velocity `F z`.

use lacuna::linalg::vector::{add_scaled, dot};
use lacuna::math::random::normal;
use lacuna::math::transform::Unconstrained;
use lacuna::plugin::Target;
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::metric::Metric;

/// A trajectory whose energy grows by more than this has left the true one, as in Stan.
pub(crate) const LARGEST_ERROR: f64 = 1000.0;

/// A place with what is known there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Point {
    /// The free coordinates.
    pub place: Vec<f64>,
    /// The log density of them; minus infinity where there is none.
    pub value: f64,
    /// Its gradient.
    pub gradient: Vec<f64>,
}

impl Point {
    pub fn at(target: &Unconstrained<'_>, place: Vec<f64>) -> Self {
        let (value, gradient) = target.gradient(&place);
        Self { place, value, gradient }
    }
}

/// A place and a momentum there.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Phase {
    pub point: Point,
    /// `z`.
    pub momentum: Vec<f64>,
    /// The force on `z`, `F'` times the gradient.
    force: Vec<f64>,
}

impl Phase {
    /// Kinetic energy less log density.
    pub fn energy(&self) -> f64 {
        0.5 * dot(&self.momentum, &self.momentum) - self.point.value
    }
}

/// The equations of motion.
#[derive(Clone, Copy)]
pub(crate) struct Flow<'a> {
    pub target: &'a Unconstrained<'a>,
    pub metric: &'a Metric,
}

impl Flow<'_> {
    /// A point with a random momentum.
    pub fn push(&self, point: &Point, rng: &mut impl Rng) -> Phase {
        let momentum = point.place.iter().map(|_| normal(rng)).collect();
        let force = self.metric.pull(&point.gradient);
        Phase { point: point.clone(), momentum, force }
    }

    /// One step of size `step`, backwards when it is negative: half a kick, a drift, half a kick.
    pub fn leapfrog(&self, phase: &mut Phase, step: f64) {
        add_scaled(&mut phase.momentum, 0.5 * step, &phase.force);
        let mut place = std::mem::take(&mut phase.point.place);
        add_scaled(&mut place, step, &self.metric.push(&phase.momentum));
        phase.point = Point::at(self.target, place);
        phase.force = self.metric.pull(&phase.point.gradient);
        add_scaled(&mut phase.momentum, 0.5 * step, &phase.force);
    }
}
