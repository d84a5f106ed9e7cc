//! Ascent by linearised densities: the Gauss-Newton method in trust regions.
//!
//! The maximum of a density about the tangent of an expensive model is cheap to find. Each step goes there, within a box
//! about the present point that shrinks if the tangent predicts the gain badly, and grows if it predicts it well (Nocedal
//! and Wright, Numerical Optimization, 2nd edition (2006), algorithm 4.1 and section 10.3).

use lacuna_base::math::Target;
use lacuna_linalg::Matrix;

use crate::bounded::Scaled;
use crate::{Ascended, FINEST, Region, laplace};

/// Largest number of steps.
const STEPS: usize = 50;
/// Largest number of boxes tried for a step.
const TRIES: usize = 20;
/// Shares of the predicted gain below which the box shrinks, and above which it grows.
const POOR: f64 = 0.25;
const GOOD: f64 = 0.75;
/// Predicted gain in log density below which the ascent ends, relative to the density.
const ROUNDING: f64 = 1e-13;
/// Predicted gain of which the density may not show anything: a model that is integrated numerically, and therefore its
/// density, is known to some digits only.
const NUMERICAL: f64 = 1e-3;
/// Predicted gain below which the point is the top: the gradient is then [small enough](crate::CONVERGED).
const SETTLED: f64 = 0.5 * crate::CONVERGED * crate::CONVERGED;
/// Predicted gain above which the point is more than a standard deviation from the top: values have to tell the way there.
const NEAR: f64 = 0.5;
/// Largest number of steps by the derivatives alone.
const SETTLING: usize = 10;

/// Climbs from a point inside the bounds; `None` if the density has no linearised form there.
pub(super) fn ascend(target: &dyn Target, start: &[f64], regions: &[Region]) -> Option<Ascended> {
    let mut near = target.linearised(start)?;
    let mut point = start.to_vec();
    // A model that is integrated numerically has another error with derivatives than without: gains are those without.
    let mut value = value_at(target, &point);
    let (mut evaluations, mut radius) = (2, 1.0);
    let mut is_hidden = false;
    for _ in 0..STEPS {
        let Some(step) = step(target, &*near, (&point, value), regions, &mut radius) else { break };
        evaluations += step.evaluations;
        is_hidden = step.is_last;
        let Some((next, reached)) = step.end else { break };
        let Some(there) = target.linearised(&next) else { break };
        evaluations += 1;
        (point, near, value) = (next, there, reached);
        if is_hidden {
            break;
        }
    }
    if is_hidden {
        evaluations += settle(target, &mut point, &mut near, regions);
    }
    let (value, gradient) = near.gradient(&point);
    let scales = laplace::scales(&*near, &point, regions);
    let is_usable = value.is_finite() && gradient.iter().all(|g| g.is_finite());
    let hidden = if is_hidden { NUMERICAL } else { 0.0 };
    is_usable.then_some(Ascended {
        point,
        value,
        gradient,
        scales,
        evaluations,
        is_top: true,
        hidden,
    })
}

/// Steps as far as the derivatives tell where the top is, once the numerical error of the density hides the gain: each has
/// to lower the gain that is still predicted (as the "approximate Wolfe conditions" of W. Hager and H. Zhang, SIAM J. Optim.
/// 16 (2005) 170, compare slopes where values are rounded). Returns the number of evaluations.
fn settle<'a>(
    target: &'a dyn Target,
    point: &mut Vec<f64>,
    near: &mut Box<dyn Target + 'a>,
    regions: &[Region],
) -> usize {
    let mut ahead = Tangent::new(&**near, point, regions).ahead(1.0);
    for tried in 0..SETTLING {
        if !(SETTLED..NEAR).contains(&ahead.predicted) {
            return tried;
        }
        let Some(there) = target.linearised(&ahead.top) else { return tried + 1 };
        let next = Tangent::new(&*there, &ahead.top, regions).ahead(1.0);
        let is_nearer = next.predicted < 0.5 * ahead.predicted;
        if !is_nearer {
            return tried + 1;
        }
        *point = std::mem::replace(&mut ahead, next).top;
        *near = there;
    }
    SETTLING
}

/// A linearised density at its point.
struct Tangent<'a> {
    near: &'a dyn Target,
    point: &'a [f64],
    regions: &'a [Region],
    present: f64,
    slopes: Vec<f64>,
    scales: Vec<f64>,
}

/// The maximum of a linearised density in a box about its point.
struct Ahead {
    top: Vec<f64>,
    /// The gain in log density that it predicts.
    predicted: f64,
}

impl<'a> Tangent<'a> {
    fn new(near: &'a dyn Target, point: &'a [f64], regions: &'a [Region]) -> Self {
        let (present, slopes) = near.gradient(point);
        let scales = laplace::scales(near, point, regions);
        Self { near, point, regions, present, slopes, scales }
    }

    fn ahead(&self, radius: f64) -> Ahead {
        let inside = around(&self.near.bounds(), self.point, self.regions, radius);
        let search = Scaled::inside(self.near, inside, self.point, &self.scales);
        let found = search.maximise(self.present, &self.slopes, FINEST);
        Ahead { top: found.point, predicted: found.value - self.present }
    }
}

/// A step that was tried.
struct Step {
    /// End of the step, with the density there; `None` if no box has a better point.
    end: Option<(Vec<f64>, f64)>,
    /// True if the next step could not gain anything.
    is_last: bool,
    evaluations: usize,
}

/// The first step that gains enough, in boxes of falling size; `None` if no gain is predicted.
fn step(
    target: &dyn Target,
    near: &dyn Target,
    (point, value): (&[f64], f64),
    regions: &[Region],
    radius: &mut f64,
) -> Option<Step> {
    let tangent = Tangent::new(near, point, regions);
    for tried in 1..=TRIES {
        let Ahead { top: next, predicted } = tangent.ahead(*radius);
        // Also false for a NaN.
        let is_enough = predicted > ROUNDING * tangent.present.abs().max(1.0);
        if !is_enough {
            return None;
        }
        let reached = value_at(target, &next);
        let gain = reached - value;
        let ratio = gain / predicted;
        let pairs = next.iter().zip(point).zip(regions);
        let extent = pairs.map(|((x, from), r)| ((x - from) / r.size).abs()).fold(0.0, f64::max);
        if ratio > GOOD && extent > 0.9 * *radius {
            *radius = (2.0 * *radius).min(1.0);
        }
        // Where the gain is not the predicted one although that is tiny, both are numerical errors of the model.
        let is_last = predicted < NUMERICAL && !(0.1..=2.0).contains(&ratio);
        let is_better = gain > 0.0 && (ratio > 0.1 || is_last);
        if ratio < POOR || ratio.is_nan() {
            *radius = POOR * extent;
        }
        if is_better || is_last {
            let end = is_better.then_some((next, reached));
            return Some(Step { end, is_last, evaluations: tried });
        }
    }
    Some(Step { end: None, is_last: true, evaluations: TRIES })
}

fn value_at(target: &dyn Target, point: &[f64]) -> f64 {
    target.log_density(&Matrix::from_rows(point.len(), [point]))[0]
}

/// The part of the bounds within a box about a point.
fn around(
    bounds: &[(f64, f64)],
    centre: &[f64],
    regions: &[Region],
    radius: f64,
) -> Vec<(f64, f64)> {
    let side = |((&(low, high), x), region): ((&(f64, f64), &f64), &Region)| {
        let reach = radius * region.size;
        ((x - reach).max(low), (x + reach).min(high))
    };
    bounds.iter().zip(centre).zip(regions).map(side).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::sync::atomic::{AtomicUsize, Ordering};

    use lacuna_base::math::random::{Stream, normal};

    use crate::*;

    /// Data of the problem Misra1a, `x` and `y`, and the certified fit of `y = b1 (1 - exp(-b2 x))`: NIST Statistical
    /// Reference Datasets, nonlinear regression.
    const MISRA: [[f64; 2]; 14] = [
        [77.6, 10.07],
        [114.9, 14.73],
        [141.1, 17.94],
        [190.8, 23.93],
        [239.9, 29.61],
        [289.0, 35.18],
        [332.8, 40.02],
        [378.4, 44.82],
        [434.8, 50.76],
        [477.3, 55.05],
        [536.8, 61.01],
        [593.1, 66.40],
        [689.1, 75.47],
        [760.0, 81.78],
    ];
    const CERTIFIED: [f64; 2] = [2.389_421_291_8e2, 5.501_564_318_1e-4];
    const SQUARES: f64 = 1.245_513_889_4e-1;
    const NOISE: f64 = 0.1;

    /// The likelihood of these data, with the number of responses that were computed. The error of the response without
    /// derivatives is `ripple`, that with derivatives adds `offset` to the log density.
    struct Misra {
        asked: AtomicUsize,
        offset: f64,
        ripple: f64,
        upper: f64,
        /// True if it has a linearised form.
        tangents: bool,
    }

    impl Misra {
        fn new(offset: f64, ripple: f64) -> Self {
            Self {
                asked: AtomicUsize::new(0),
                offset,
                ripple,
                upper: f64::INFINITY,
                tangents: true,
            }
        }
        fn response(&self, b: &[f64]) -> Vec<f64> {
            self.asked.fetch_add(1, Ordering::Relaxed);
            MISRA.iter().map(|[x, _]| b[0] * (1.0 - (-b[1] * x).exp())).collect()
        }
        fn jacobian(b: &[f64]) -> Matrix {
            let by = |i: usize, j: usize| {
                let x = MISRA[i][0];
                let decay = (-b[1] * x).exp();
                if j == 0 { 1.0 - decay } else { b[0] * x * decay }
            };
            Matrix::from_fn(MISRA.len(), 2, by)
        }
        fn slopes(response: &[f64], jacobian: &Matrix) -> (f64, Vec<f64>) {
            let off: Vec<f64> =
                MISRA.iter().zip(response).map(|([_, y], m)| (y - m) / NOISE).collect();
            let slope = |j: usize| (0..off.len()).map(|i| off[i] * jacobian[(i, j)] / NOISE).sum();
            (-0.5 * norm(&off).powi(2), (0..2).map(slope).collect())
        }
    }

    impl Target for Misra {
        fn dimension(&self) -> usize {
            2
        }
        fn log_density(&self, points: &Matrix) -> Vec<f64> {
            let of = |b: &[f64]| {
                let error = self.ripple * (1e9 * b[0] + 1e15 * b[1]).sin();
                Self::slopes(&self.response(b), &Self::jacobian(b)).0 + error
            };
            points.iter_rows().map(of).collect()
        }
        fn log_prior(&self, points: &Matrix) -> Vec<f64> {
            vec![0.0; points.rows()]
        }
        fn gradient(&self, b: &[f64]) -> (f64, Vec<f64>) {
            let (value, slopes) = Self::slopes(&self.response(b), &Self::jacobian(b));
            (value + self.offset, slopes)
        }
        fn bounds(&self) -> Vec<(f64, f64)> {
            vec![(0.0, self.upper), (0.0, f64::INFINITY)]
        }
        fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
            let mut rng = stream.generator();
            Matrix::from_fn(count, 2, |_, j| [300.0, 4e-4][j] * (0.5 * normal(&mut rng)).exp())
        }
        fn linearised(&self, point: &[f64]) -> Option<Box<dyn Target + '_>> {
            if !self.tangents {
                return None;
            }
            let (response, jacobian) = (self.response(point), Self::jacobian(point));
            Some(Box::new(Tangent { of: self, at: point.to_vec(), response, jacobian }))
        }
    }

    struct Tangent<'a> {
        of: &'a Misra,
        at: Vec<f64>,
        response: Vec<f64>,
        jacobian: Matrix,
    }

    impl Target for Tangent<'_> {
        fn dimension(&self) -> usize {
            2
        }
        fn log_density(&self, points: &Matrix) -> Vec<f64> {
            points.iter_rows().map(|b| self.gradient(b).0).collect()
        }
        fn log_prior(&self, points: &Matrix) -> Vec<f64> {
            self.of.log_prior(points)
        }
        fn gradient(&self, b: &[f64]) -> (f64, Vec<f64>) {
            let moved: Vec<f64> = b.iter().zip(&self.at).map(|(b, at)| b - at).collect();
            let change = lacuna_linalg::multiply_vector(&self.jacobian, &moved);
            let response: Vec<f64> = self.response.iter().zip(change).map(|(y, d)| y + d).collect();
            let (value, slopes) = Misra::slopes(&response, &self.jacobian);
            (value + self.of.offset, slopes)
        }
        fn bounds(&self) -> Vec<(f64, f64)> {
            self.of.bounds()
        }
        fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
            self.of.prior_draws(count, stream)
        }
    }

    fn fitted(target: &Misra) -> (Vec<Optimum>, usize) {
        // Both starts that NIST gives, the first one far away.
        let found = maximise(target, &Matrix::from_rows(2, [[500.0, 1e-4], [250.0, 5e-4]]));
        (found, target.asked.load(Ordering::Relaxed))
    }

    #[test]
    fn a_certified_regression_takes_few_responses() {
        let (found, asked) = fitted(&Misra::new(0.0, 0.0));
        assert_eq!(found.len(), 1);
        for (found, certified) in found[0].point.iter().zip(CERTIFIED) {
            assert!((found / certified - 1.0).abs() < 1e-7, "{found} {certified}");
        }
        let squares = -2.0 * found[0].value * NOISE * NOISE;
        assert!(found[0].converged && (squares / SQUARES - 1.0).abs() < 1e-8, "{squares}");
        let (_, by_gradients) = fitted(&Misra { tangents: false, ..Misra::new(0.0, 0.0) });
        assert!(3 * asked < 2 * by_gradients, "{asked}, {by_gradients} by gradients");
    }

    /// As of a differential equation that is integrated with a finite tolerance.
    #[test]
    fn numerical_errors_of_the_density_do_not_hold_it_up() {
        for offset in [-0.2, 0.2] {
            let (found, asked) = fitted(&Misra::new(offset, 1e-5));
            assert_eq!(found.len(), 1, "{offset}");
            assert!(found[0].converged && asked < 90, "{offset}: {asked}");
            let sd = [2.7, 7.3e-6];
            for ((found, certified), sd) in found[0].point.iter().zip(CERTIFIED).zip(sd) {
                assert!((found - certified).abs() < 0.01 * sd, "{offset}: {found} {certified}");
            }
        }
    }

    /// The error of the density is larger than the gains here, and the derivatives still tell where the top is: starts that met
    /// are one maximum, and no search goes through the error.
    #[test]
    fn a_top_hidden_by_numerical_errors_is_found_by_its_derivatives() {
        let target = Misra::new(0.2, 0.2);
        let starts = Matrix::from_fn(16, 2, |i, j| CERTIFIED[j] * (1.0 + 0.01 * (i + j) as f64));
        let found = maximise(&target, &starts);
        let asked = target.asked.load(Ordering::Relaxed);
        assert_eq!(found.len(), 1);
        assert!(found[0].converged && asked < 16 * 20, "{asked}");
        for ((found, certified), sd) in found[0].point.iter().zip(CERTIFIED).zip([2.7, 7.3e-6]) {
            assert!((found - certified).abs() < 0.01 * sd, "{found} {certified}");
        }
    }

    #[test]
    fn a_bound_holds_it() {
        let target = Misra { upper: 230.0, ..Misra::new(0.0, 0.0) };
        let found = &fitted(&target).0[0];
        assert!(found.converged && found.point[0] == 230.0);
        // The best second unknown given the first: its slope is zero.
        let slope = target.gradient(&found.point).1[1] * 1e-6;
        assert!(slope.abs() < 1e-3, "{slope}");
    }
}
