//! The search for the largest density from one start, by Levenberg and Marquardt's steps inside the bounds of the priors.

use lacuna_linalg::vector::dot;
use lacuna_linalg::{Matrix, multiply_vector};

use super::System;
use super::coordinate::{inner, log_slope};
use super::fit::{Fit, GAIN, at, residual};
use super::step::within;
use super::whitener::Whitener;
use super::window::Window;

/// Smallest gain in log density that a step has to promise to be tried.
const PROMISED: f64 = 1e-11;

/// Largest number of tries of a step, each with eight times the damping.
const TRIES: usize = 10;

/// A promised gain that the numerical error of a model's values may hide: a step that fails to gain it is the last one.
const HIDDEN: f64 = 1e-3;

/// Smallest damping after a failed try, relative to the curvature.
const LEAST: f64 = 1e-4;

/// Damping above which a small gain may be that of a short step, so that the fit continues.
const SHORT: f64 = 1e-3;

/// The share of its distance from what is of interest that a step of a fit has to gain. Far from a good fit Gauss-Newton
/// steps gain little each, and many of them would improve a fit of which nothing depends.
const SLOW: f64 = 0.01;

/// The shares of the promised gain above which the damping falls, and below which it rises after a step (Nocedal and
/// Wright, algorithm 4.1).
const KEPT: [f64; 2] = [0.25, 0.75];

/// The multiple of the gain that the next step promises which a search may still gain.
pub(super) const HOPE: f64 = 4.0;

/// A search for the largest density, on its way.
pub(super) struct Ascent<'a, 'b> {
    system: &'b System<'a>,
    whitener: &'b Whitener,
    means: &'b [f64],
    bounds: Vec<(f64, f64)>,
    /// The values that count; `None` for all.
    window: Option<Window>,
    /// The unknowns at which the search began.
    pub start: Vec<f64>,
    pub best: Fit,
    damping: f64,
    /// The log density there from a response without derivatives, once it is needed. A model that is integrated numerically
    /// has another error with derivatives: gains of trial steps are those without.
    plain: Option<f64>,
    /// The log density below which the fit need not be accurate.
    pub of_interest: f64,
    /// The gain in log density that the next step promises; zero at the end of the search.
    pub promised: f64,
}

impl<'a, 'b> Ascent<'a, 'b> {
    pub fn from(
        system: &'b System<'a>,
        whitener: &'b Whitener,
        means: &'b [f64],
        start: &[f64],
    ) -> Self {
        Self::inside(system, whitener, means, start, None)
    }

    pub fn inside(
        system: &'b System<'a>,
        whitener: &'b Whitener,
        means: &'b [f64],
        start: &[f64],
        window: Option<Window>,
    ) -> Self {
        let bounds = system.priors().iter().zip(system.bounds());
        let bounds: Vec<(f64, f64)> = bounds.map(|(prior, own)| inner(prior, own)).collect();
        let start: Vec<f64> =
            start.iter().zip(&bounds).map(|(x, (low, high))| x.clamp(*low, *high)).collect();
        let best = at(system, whitener, means, &start);
        let best = window.iter().fold(best, |best, window| window.of_fit(best));
        Self {
            system,
            whitener,
            means,
            bounds,
            window,
            start,
            best,
            damping: 1e-3,
            plain: None,
            of_interest: f64::NEG_INFINITY,
            promised: f64::INFINITY,
        }
    }

    /// The log density in the searched coordinates.
    pub fn height(&self) -> f64 {
        self.merit(self.best.log_density, &self.best.at.point)
    }

    fn merit(&self, log_density: f64, point: &[f64]) -> f64 {
        log_density + log_slope(self.system.priors(), point)
    }

    /// Climbs by at most so many steps, or to the end.
    pub fn climb(&mut self, steps: usize) {
        for _ in 0..steps {
            if self.promised == 0.0 {
                break;
            }
            let Some((point, promised, plain)) = self.improved() else {
                self.promised = 0.0;
                break;
            };
            let short = self.damping > SHORT;
            let before = self.height();
            let best = at(self.system, self.whitener, self.means, &point);
            self.best = self.window.iter().fold(best, |best, window| window.of_fit(best));
            self.plain = Some(plain);
            let gain = self.height() - before;
            self.damp(gain / promised);
            let is_slow = gain < SLOW * (self.of_interest - self.best.log_density);
            if is_slow || gain < GAIN && !short {
                self.promised = 0.0;
            }
        }
        if self.promised > 0.0 {
            self.promised = step(self.system, &self.best, self.damping, &self.bounds).1;
        }
    }

    /// Climbs by at most so many steps; returns false if the misfit stays above `largest`. Ends as soon as the gain that
    /// the next step promises is too small for that.
    pub fn climb_below(&mut self, largest: f64, steps: usize) -> bool {
        for _ in 0..steps {
            self.climb(1);
            if self.best.misfit() - HOPE * self.promised > largest {
                return false;
            }
        }
        self.best.misfit() <= largest
    }

    /// The log density at a point, of the values that count.
    fn log_density(&self, point: &[f64]) -> f64 {
        let response = self.system.response(point);
        if response.iter().any(|y| !y.is_finite()) {
            return f64::NEG_INFINITY;
        }
        let mut z = self.whitener.whiten(&residual(self.means, &response));
        self.window.iter().for_each(|window| window.cut(&mut z));
        -0.5 * dot(&z, &z) + self.system.log_prior(point)
    }

    /// The damping after a step that kept this share of the promised gain.
    fn damp(&mut self, kept: f64) {
        let [few, most] = KEPT;
        if kept > most {
            self.damping = (self.damping * 0.1).max(1e-12);
        } else if kept < few {
            self.damping = (self.damping * 2.0).max(LEAST);
        }
    }

    /// A point of larger density, with the gain that was promised and the density there. A step that does not improve is
    /// repeated with more damping: shorter, and closer to the gradient.
    fn improved(&mut self) -> Option<(Vec<f64>, f64, f64)> {
        let here = &self.best.at.point;
        let plain = self.plain.unwrap_or_else(|| self.log_density(here));
        self.plain = Some(plain);
        let height = self.merit(plain, here);
        for _ in 0..TRIES {
            let (point, promised) = step(self.system, &self.best, self.damping, &self.bounds);
            if promised < PROMISED {
                return None;
            }
            let density = self.log_density(&point);
            if self.merit(density, &point) > height {
                return Some((point, promised, density));
            }
            if promised < HIDDEN && self.damping <= SHORT {
                return None;
            }
            self.damping = (self.damping * 8.0).max(LEAST);
        }
        None
    }
}

/// The next point, by a damped Gauss-Newton step in units of the priors' widths, inside the bounds; and the gain in log
/// density that the damped quadratic promises.
fn step(system: &System<'_>, here: &Fit, damping: f64, bounds: &[(f64, f64)]) -> (Vec<f64>, f64) {
    let point = &here.at.point;
    let coordinates = system.coordinates();
    let unit: Vec<f64> = coordinates.iter().zip(point).map(|(own, &x)| own.unit(x)).collect();
    let mut gradient = multiply_vector(&here.slopes, &here.residual);
    for (j, g) in gradient.iter_mut().enumerate() {
        *g = (*g + coordinates[j].slope(point[j])) * unit[j];
    }
    let hessian = here.hessian();
    let damped = Matrix::from_fn(point.len(), point.len(), |i, j| {
        let value = unit[i] * hessian[(i, j)] * unit[j];
        if i == j { value * (1.0 + damping) + 1e-12 + damping } else { value }
    });
    let room = (0..point.len()).map(|j| coordinates[j].room(point[j], bounds[j]));
    let (low, high): (Vec<f64>, Vec<f64>) = room.unzip();
    // Without a Cholesky factor there is no step, and the fit ends at the present point.
    let Some(shift) = within(&damped, &gradient, &low, &high) else {
        return (point.clone(), 0.0);
    };
    let promised = dot(&gradient, &shift) - 0.5 * dot(&shift, &multiply_vector(&damped, &shift));
    let next = |j: usize| coordinates[j].moved(point[j], shift[j]).clamp(bounds[j].0, bounds[j].1);
    ((0..point.len()).map(next).collect(), promised)
}

#[cfg(test)]
mod tests {
    use lacuna::data::{Measurements, Replicate};
    use lacuna::math::distribution::Distribution;
    use lacuna::math::random::{Stream, normal};
    use lacuna::plugin::Forward;
    use lacuna_linalg::Matrix;

    use crate::gap::experiment::Experiment;
    use crate::gap::system::System;
    use crate::gap::system::fit::fit;
    use crate::gap::system::whitener::Whitener;
    use crate::gap::testing::SyntheticExperiment;

    const POINTS: usize = 60;

    /// A level, whose response without derivatives has a numerical error of a third of the noise.
    struct Level;

    impl Forward for Level {
        fn dimension(&self) -> usize {
            1
        }
        fn outputs(&self) -> usize {
            POINTS
        }
        fn mean(&self, points: &Matrix) -> Matrix {
            let error = |t: usize| if t.is_multiple_of(2) { 0.3 } else { -0.3 };
            Matrix::from_fn(points.rows(), POINTS, |i, t| points[(i, 0)] + error(t))
        }
        fn jacobian(&self, _: &[f64]) -> Matrix {
            Matrix::from_fn(POINTS, 1, |_, _| 1.0)
        }
        fn mean_and_jacobian(&self, point: &[f64]) -> (Vec<f64>, Matrix) {
            (vec![point[0]; POINTS], self.jacobian(point))
        }
    }

    /// Closed form: the mean of the data, whose standard deviation is that of the noise by the root of their number.
    #[test]
    fn an_error_of_values_without_derivatives_does_not_hold_a_fit_up() {
        let mut world =
            SyntheticExperiment::new(&["c"], &["s"], POINTS, 0.0, &["level"], |_, _, _, _| 0.0);
        world.parameters[0].prior = Distribution::Normal([0.0, 100.0]);
        let mut rng = Stream::root(6).generator();
        let values: Vec<f64> = (0..POINTS).map(|_| 5.0 + normal(&mut rng)).collect();
        let mean = values.iter().sum::<f64>() / POINTS as f64;
        let replicate = Replicate::new("1", values.into_iter().map(Some).collect());
        let measured = Measurements::new(world.layouts.blocks[0].clone(), vec![replicate]).into();
        let experiment = Experiment::new(&world.layouts, &world.parameters, &Level, &measured);
        let (_, means) = experiment.means();
        let whitener = Whitener::new(&experiment, &world.noise, &means);
        let system = System::new(&experiment, Vec::new());
        let sd = (POINTS as f64).sqrt().recip();
        for off in [-1.5, 1.5] {
            let found = fit(&system, &whitener, &means, &[mean + off * sd]).at.point[0];
            assert!((found - mean).abs() < 0.05 * sd, "{off}: {found} {mean} ± {sd}");
        }
    }
}
