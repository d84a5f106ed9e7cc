//! Search for the point of the failure region that is nearest to the origin.

use lacuna::plugin::reliability::DesignPoint;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::{dot, norm};

use crate::reliability::common::Counted;

/// Settings of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Step of the finite differences.
    pub step: f64,
    /// Relative tolerance of value and direction.
    pub tolerance: f64,
    /// Largest number of iterations.
    pub iterations: usize,
}

/// Elevation of the limit state around a design point that has been found, which makes the search find another one
/// (Der Kiureghian and Dakessian, Structural Safety 20 (1998) 37).
#[derive(Debug, Clone, PartialEq)]
pub struct Bulge {
    centre: Vec<f64>,
    radius: f64,
    height: f64,
}

/// Radius of a bulge and distance at which the raised limit state is zero, as shares of the distance of its point.
const RADIUS: f64 = 1.1;
const ZERO: f64 = 0.75;

impl Bulge {
    /// The bulge at a design point where the gradient has this norm.
    pub fn at(found: &Found) -> Self {
        let beta = found.design.distance.abs().max(0.5);
        let (radius, zero) = (RADIUS * beta, ZERO * beta);
        let height = found.slope * zero / (radius * radius - zero * zero).powi(2);
        Self { centre: found.design.point.clone(), radius, height }
    }

    fn excess(&self, u: &[f64]) -> f64 {
        let square: f64 = u.iter().zip(&self.centre).map(|(a, b)| (a - b) * (a - b)).sum();
        (self.radius * self.radius - square).max(0.0)
    }

    fn value(&self, u: &[f64]) -> f64 {
        self.height * self.excess(u).powi(2)
    }

    fn add_gradient(&self, u: &[f64], gradient: &mut [f64]) {
        let factor = -4.0 * self.height * self.excess(u);
        for ((slope, a), b) in gradient.iter_mut().zip(u).zip(&self.centre) {
            *slope += factor * (a - b);
        }
    }

    /// True near the point of the bulge, where a result belongs to the bulge and not to the limit state.
    fn holds(&self, u: &[f64]) -> bool {
        self.excess(u) > 0.0
    }
}

/// Result of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The last point.
    pub design: DesignPoint,
    /// Norm of the gradient there.
    pub slope: f64,
    /// Value there.
    pub value: f64,
    /// True if the tolerances are met.
    pub settled: bool,
    /// True if they are met outside all bulges.
    pub converged: bool,
}

/// Follows the iteration of Hasofer, Lind, Rackwitz and Fiessler with the line search of Zhang and Der Kiureghian (Proc. 6th
/// IFIP WG 7.5, 1995, 297) on the merit `|u|^2 / 2 + c |g(u)|`; `None` if the limit state has no answer or no slope at
/// the start.
pub fn search(
    state: &Counted<'_>,
    start: &[f64],
    bulges: &[Bulge],
    settings: Settings,
) -> Result<Option<Found>, Stop> {
    let raised = |u: &[f64], value: f64| value + bulges.iter().map(|b| b.value(u)).sum::<f64>();
    let mut u = start.to_vec();
    let mut value = raised(&u, state.value(&u)?);
    let scale = value.abs().max(f64::MIN_POSITIVE);
    let mut penalty = 0.0_f64;
    let mut best: Option<Found> = None;
    for _ in 0..settings.iterations {
        let Some(gradient) = gradient(state, &u, value, bulges, settings.step)? else { break };
        let slope = norm(&gradient);
        if !(slope > 0.0 && slope.is_finite()) {
            break;
        }
        let found = reached(&u, value, &gradient, slope, bulges, settings, scale);
        let done = found.settled;
        best = Some(found);
        if done {
            break;
        }
        let factor = (dot(&gradient, &u) - value) / (slope * slope);
        let direction: Vec<f64> = gradient.iter().zip(&u).map(|(g, u)| factor * g - u).collect();
        penalty = penalty.max(2.0 * norm(&u) / slope);
        if value.abs() > settings.tolerance * scale {
            let ahead: f64 = direction.iter().zip(&u).map(|(d, u)| (d + u) * (d + u)).sum();
            penalty = penalty.max(ahead / value.abs());
        }
        let merit = |u: &[f64], value: f64| 0.5 * dot(u, u) + penalty * value.abs();
        let before = merit(&u, value);
        let descent = dot(&u, &direction) + penalty * value.signum() * dot(&gradient, &direction);
        let mut length = 1.0;
        for halving in 0..HALVINGS {
            let next: Vec<f64> = u.iter().zip(&direction).map(|(u, d)| u + length * d).collect();
            let there = raised(&next, state.value(&next)?);
            let enough = merit(&next, there) <= before + ARMIJO * length * descent.min(0.0);
            if enough || (halving + 1 == HALVINGS && there.is_finite()) {
                (u, value) = (next, there);
                break;
            }
            length *= 0.5;
        }
    }
    Ok(best)
}

const HALVINGS: usize = 8;
const ARMIJO: f64 = 0.1;

fn reached(
    u: &[f64],
    value: f64,
    gradient: &[f64],
    slope: f64,
    bulges: &[Bulge],
    settings: Settings,
    scale: f64,
) -> Found {
    let direction: Vec<f64> = gradient.iter().map(|g| -g / slope).collect();
    let along = dot(&direction, u);
    let aside: f64 = u.iter().zip(&direction).map(|(u, a)| (u - along * a).powi(2)).sum();
    let near = value.abs() <= settings.tolerance * scale.max(slope);
    let aligned = aside.sqrt() <= settings.tolerance.sqrt() * 0.3 * norm(u).max(1.0);
    let settled = near && aligned;
    let converged = settled && !bulges.iter().any(|bulge| bulge.holds(u));
    // The limit state is linear over the remaining value.
    let distance = along + value / slope;
    Found {
        design: DesignPoint { point: u.to_vec(), distance, direction },
        slope,
        value,
        settled,
        converged,
    }
}

/// Gradient by forward differences; `None` if the model has no answer there.
fn gradient(
    state: &Counted<'_>,
    u: &[f64],
    value: f64,
    bulges: &[Bulge],
    step: f64,
) -> Result<Option<Vec<f64>>, Stop> {
    let moved = Matrix::from_fn(u.len(), u.len(), |i, j| u[j] + if i == j { step } else { 0.0 });
    let base = value - bulges.iter().map(|b| b.value(u)).sum::<f64>();
    let mut gradient: Vec<f64> =
        state.values(&moved)?.into_iter().map(|there| (there - base) / step).collect();
    for bulge in bulges {
        bulge.add_gradient(u, &mut gradient);
    }
    Ok(Some(gradient).filter(|g| g.iter().all(|slope| slope.is_finite())))
}
