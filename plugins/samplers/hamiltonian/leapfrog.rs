//! Leapfrog integration of the Hamiltonian dynamics of a log density (Neal 2011, section 5.2.3).
//!
//! With the covariance `F F'` as the inverse of the mass matrix, a momentum `p` is stored as `z = F' p`, which is
//! standard normal: the kinetic energy is `z'z / 2` and the velocity `F z`.

use lacuna::math::random::normal;
use lacuna::math::transform::Unconstrained;
use lacuna::plugin::Target;
use lacuna_linalg::vector::{add_scaled, dot};
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::metric::Metric;

/// Energy error above which a trajectory counts as divergent, as in Stan.
pub(crate) const LARGEST_ERROR: f64 = 1000.0;

/// A point with log density and gradient.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Point {
    /// Free (unconstrained) coordinates.
    pub place: Vec<f64>,
    /// Log density in the free coordinates; minus infinity if it has no value.
    pub value: f64,
    /// Gradient of `value`.
    pub gradient: Vec<f64>,
}

impl Point {
    pub fn at(target: &Unconstrained<'_>, place: Vec<f64>) -> Self {
        let (value, gradient) = target.gradient(&place);
        Self { place, value, gradient }
    }
}

/// A point in phase space.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Phase {
    pub point: Point,
    /// Momentum, as `z`.
    pub momentum: Vec<f64>,
    /// Force on `z`: `F'` times the gradient.
    force: Vec<f64>,
}

impl Phase {
    /// Returns the Hamiltonian: kinetic energy minus log density.
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
    /// Gives a point a random momentum.
    pub fn push(&self, point: &Point, rng: &mut impl Rng) -> Phase {
        let momentum = point.place.iter().map(|_| normal(rng)).collect();
        let force = self.metric.pull(&point.gradient);
        Phase { point: point.clone(), momentum, force }
    }

    /// Makes one leapfrog step of size `step`, backwards if it is negative: half a kick, a drift, half a kick.
    pub fn leapfrog(&self, phase: &mut Phase, step: f64) {
        add_scaled(&mut phase.momentum, 0.5 * step, &phase.force);
        let mut place = std::mem::take(&mut phase.point.place);
        add_scaled(&mut place, step, &self.metric.push(&phase.momentum));
        phase.point = Point::at(self.target, place);
        phase.force = self.metric.pull(&phase.point.gradient);
        add_scaled(&mut phase.momentum, 0.5 * step, &phase.force);
    }
}
