//! L-BFGS-B of the `basin` crate in scaled coordinates; nothing else of that crate is used.

use std::cell::RefCell;
use std::convert::Infallible;

use basin::{
    BoxBounds, ConstraintDescription, ConstraintSet, Constraints, CostFunction, Executor,
    FirstOrderState, Gradient, Lbfgs,
};
use lacuna_base::math::Target;
use lacuna_linalg::vector::norm;

use crate::Precision;

/// A log density as a cost to be minimised, in coordinates `(x - origin) / scale`.
pub(super) struct Scaled<'a> {
    target: &'a dyn Target,
    origin: Vec<f64>,
    scales: Vec<f64>,
    bounds: Vec<(f64, f64)>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

/// Result of a search.
pub(super) struct Reached {
    pub point: Vec<f64>,
    pub value: f64,
    pub gradient: Vec<f64>,
    pub evaluations: usize,
}

impl<'a> Scaled<'a> {
    /// Coordinates centred at `origin`.
    pub fn new(target: &'a dyn Target, origin: &[f64], scales: &[f64]) -> Self {
        Self::inside(target, target.bounds(), origin, scales)
    }

    /// Coordinates centred at `origin`, within these bounds, which lie inside those of the target.
    pub fn inside(
        target: &'a dyn Target,
        bounds: Vec<(f64, f64)>,
        origin: &[f64],
        scales: &[f64],
    ) -> Self {
        let scaled = |bound: fn(&(f64, f64)) -> f64| {
            bounds.iter().zip(origin).zip(scales).map(|((b, x), s)| (bound(b) - x) / s).collect()
        };
        let (lower, upper) = (scaled(|b| b.0), scaled(|b| b.1));
        Self { target, origin: origin.to_vec(), scales: scales.to_vec(), bounds, lower, upper }
    }

    /// Searches from the origin, where log density and gradient are known, until the gradient is below
    /// `precision.gradient` per unit of the coordinates or a step gains too little.
    pub fn maximise(self, value: f64, gradient: &[f64], precision: Precision) -> Reached {
        let best = Evaluation {
            point: vec![0.0; self.origin.len()],
            cost: -value,
            gradient: gradient.iter().zip(&self.scales).map(|(g, s)| -g * s).collect(),
        };
        let record = RefCell::new(Record { best: best.clone(), last: best, count: 0 });
        let cost = Cost { scaled: &self, record: &record };
        // A step that gains no more than round-off ends the search: anything after it is a random walk in noise.
        let solver = Lbfgs::new()
            .with_absolute_projected_gradient_tolerance(precision.gradient)
            .with_relative_cost_reduction_tolerance(precision.gain);
        let start = FirstOrderState::new(vec![0.0; self.origin.len()]);
        // The best point is taken from the record, so that a search that fails midway still counts.
        let _ = Executor::new(cost, solver, start).max_iter(precision.steps).run();
        let Record { best, count, .. } = record.into_inner();
        let gradient = best.gradient.iter().zip(&self.scales).map(|(g, s)| -g / s).collect();
        let point = self.natural(&best.point);
        Reached { point, value: -best.cost, gradient, evaluations: count }
    }

    /// The coordinates of the target, clamped because rounding must not carry a point over its bound.
    fn natural(&self, u: &[f64]) -> Vec<f64> {
        (0..u.len())
            .map(|j| {
                let (lo, hi) = self.bounds[j];
                let at_bound = if u[j] <= self.lower[j] {
                    Some(lo)
                } else if u[j] >= self.upper[j] {
                    Some(hi)
                } else {
                    None
                };
                // A coordinate on its scaled bound is returned as the bound itself: `origin + u * scale` may miss it by
                // rounding.
                at_bound.unwrap_or_else(|| (self.origin[j] + u[j] * self.scales[j]).max(lo).min(hi))
            })
            .collect()
    }
}

#[derive(Clone)]
struct Evaluation {
    point: Vec<f64>,
    cost: f64,
    gradient: Vec<f64>,
}

struct Record {
    /// Lowest cost so far.
    best: Evaluation,
    /// Last evaluation; a solver often asks for the same point twice, for cost and then gradient.
    last: Evaluation,
    count: usize,
}

/// The cost function that the solver calls.
struct Cost<'a, 'b> {
    scaled: &'b Scaled<'a>,
    record: &'b RefCell<Record>,
}

impl Cost<'_, '_> {
    fn evaluate(&self, u: &[f64]) -> (f64, Vec<f64>) {
        let mut record = self.record.borrow_mut();
        if record.last.point == u {
            return (record.last.cost, record.last.gradient.clone());
        }
        record.count += 1;
        let (value, gradient) = self.scaled.target.gradient(&self.scaled.natural(u));
        let scaled = gradient.iter().zip(&self.scaled.scales).map(|(g, s)| -g * s);
        let gradient: Vec<f64> = scaled.collect();
        let evaluation = if value.is_finite() && gradient.iter().all(|g| g.is_finite()) {
            Evaluation { point: u.to_vec(), cost: -value, gradient }
        } else {
            wall(&record.best, u)
        };
        // The solver may end on a worse point, or fail; the best evaluation is kept in any case.
        if evaluation.cost < record.best.cost {
            record.best = evaluation.clone();
        }
        record.last = evaluation;
        (record.last.cost, record.last.gradient.clone())
    }
}

/// Replacement for an evaluation where the density is zero or undefined: a slope away from the best point, as steep as
/// the descent that led here, so that the line search interpolates a shorter step.
fn wall(best: &Evaluation, u: &[f64]) -> Evaluation {
    let away: Vec<f64> = u.iter().zip(&best.point).map(|(x, b)| x - b).collect();
    let distance = norm(&away);
    let steepness = norm(&best.gradient).max(f64::MIN_POSITIVE);
    Evaluation {
        point: u.to_vec(),
        cost: best.cost + steepness * distance,
        gradient: away.iter().map(|x| steepness * x / distance.max(f64::MIN_POSITIVE)).collect(),
    }
}

impl Constraints for Cost<'_, '_> {
    type Set = ConstraintSet<BoxBounds<Vec<f64>>>;

    fn constraints(&self) -> <Self::Set as ConstraintDescription>::Borrowed<'_> {
        let bounds = BoxBounds::new(Some(&self.scaled.lower), Some(&self.scaled.upper));
        ConstraintSet::new().with_bounds(bounds)
    }
}

impl CostFunction for Cost<'_, '_> {
    type Param = Vec<f64>;
    type Output = f64;
    type Error = Infallible;

    fn cost(&self, u: &Vec<f64>) -> Result<f64, Infallible> {
        Ok(self.evaluate(u).0)
    }
}

impl Gradient for Cost<'_, '_> {
    type Gradient = Vec<f64>;

    fn gradient(&self, u: &Vec<f64>) -> Result<Vec<f64>, Infallible> {
        Ok(self.evaluate(u).1)
    }
}
