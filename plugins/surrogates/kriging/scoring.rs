//! Scoring: the search that uses the information of the likelihood.

use lacuna::linalg::vector::dot;
use lacuna::linalg::{Cholesky, Matrix, multiply_vector};
use lacuna::plugin::Target;

use super::likelihood::{Restricted, Slopes};

/// A step that promises less than this in log-likelihood is not made.
const GAIN: f64 = 1e-4;
/// The longest steps in the logarithms of a length scale and of the nugget, which often has far to go.
const LONGEST: [f64; 2] = [1.0, 10.0];
/// A likelihood is the dear part: so many of them are enough.
const MOST: usize = 40;
/// How many of the last steps correct the information.
const MEMORY: usize = 4;

/// The maximum of the likelihood that a point leads to, and whether it was reached; none where the point has no
/// likelihood.
///
/// Steps are those of Newton's method with the average information in place of the curvature (Gilmour, Thompson
/// and Cullis 1995), which costs little more than the gradient. The response of a simulator is no draw of the
/// process, so that the information is wrong by factors: what the gradient did along the last steps corrects it
/// (BFGS). Steps are damped (Levenberg and Marquardt) until the likelihood rises; coordinates that are pressed
/// against a bound stay there.
pub fn score(problem: &Restricted<'_>, start: &[f64]) -> Option<(Vec<f64>, bool)> {
    let bounds = Target::bounds(problem);
    let mut point = start.to_vec();
    let mut here = problem.slopes(&point)?;
    let mut steps: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
    let mut damping = 0.0;
    for _ in 0..MOST {
        let curvature = corrected(&here.information, &steps);
        let free = free(&point, &here.gradient, &bounds);
        let longest = |j: usize| LONGEST[usize::from(j == problem.points.rows())];
        let place = Place { point: &point, here: &here, curvature: &curvature, free: &free };
        let Some(next) = place.step(&bounds, damping, longest) else { break };
        let promise = place.promise(&next);
        if promise < GAIN {
            // A step that a bound cuts short promises nothing of what the other coordinates could gain.
            let cut = (next.iter().zip(&point).zip(&bounds))
                .any(|((x, y), (low, high))| x != y && (x <= low || x >= high));
            return Some((point, !cut));
        }
        let there = problem.slopes(&next);
        let rises = there.as_ref().is_some_and(|there| there.value > here.value);
        if let Some(there) = there {
            let moved = next.iter().zip(&point).map(|(a, b)| a - b).collect();
            let slowed = here.gradient.iter().zip(&there.gradient).map(|(a, b)| a - b).collect();
            steps.push((moved, slowed));
            if rises {
                (point, here) = (next, there);
                damping *= 0.1;
                continue;
            }
        }
        damping = (10.0 * damping).max(0.1);
        if damping > 1e6 {
            break;
        }
    }
    Some((point, false))
}

/// The coordinates that no bound holds.
fn free(point: &[f64], gradient: &[f64], bounds: &[(f64, f64)]) -> Vec<usize> {
    let held = |j: usize| {
        let (low, high) = bounds[j];
        (point[j] <= low && gradient[j] <= 0.0) || (point[j] >= high && gradient[j] >= 0.0)
    };
    (0..point.len()).filter(|&j| !held(j)).collect()
}

/// The information with the curvature that the last steps have met, where that is positive.
fn corrected(information: &Matrix, steps: &[(Vec<f64>, Vec<f64>)]) -> Matrix {
    let mut curvature = information.clone();
    for (moved, slowed) in &steps[steps.len().saturating_sub(MEMORY)..] {
        let expected = multiply_vector(&curvature, moved);
        let (met, promised) = (dot(moved, slowed), dot(moved, &expected));
        if met <= 1e-2 * promised || promised <= 0.0 {
            continue;
        }
        for i in 0..moved.len() {
            for j in 0..moved.len() {
                curvature[(i, j)] +=
                    slowed[i] * slowed[j] / met - expected[i] * expected[j] / promised;
            }
        }
    }
    curvature
}

/// The likelihood's quadratic model around a point.
struct Place<'a> {
    point: &'a [f64],
    here: &'a Slopes,
    curvature: &'a Matrix,
    free: &'a [usize],
}

impl Place<'_> {
    fn entry(&self, i: usize, j: usize) -> f64 {
        self.curvature[(self.free[i], self.free[j])]
    }

    /// Where the damped step leads within the bounds.
    fn step(
        &self,
        bounds: &[(f64, f64)],
        damping: f64,
        longest: impl Fn(usize) -> f64,
    ) -> Option<Vec<f64>> {
        let count = self.free.len();
        // Where there is nearly no curvature the floor keeps the step finite.
        let floor = 1e-10 + 1e-6 * (0..count).map(|i| self.entry(i, i)).fold(0.0, f64::max);
        let damped = Matrix::from_fn(count, count, |i, j| {
            let more = if i == j { damping * self.entry(i, i) + floor } else { 0.0 };
            self.entry(i, j) + more
        });
        let mut step: Vec<f64> = self.free.iter().map(|&j| self.here.gradient[j]).collect();
        Cholesky::new(&damped).ok()?.solve(&mut step);
        let mut next = self.point.to_vec();
        for (&j, s) in self.free.iter().zip(&step) {
            let s = s.clamp(-longest(j), longest(j));
            next[j] = (next[j] + s).clamp(bounds[j].0, bounds[j].1);
        }
        Some(next)
    }

    /// The gain that the quadratic promises at another point.
    fn promise(&self, next: &[f64]) -> f64 {
        let moved: Vec<f64> = next.iter().zip(self.point).map(|(a, b)| a - b).collect();
        let bent = multiply_vector(self.curvature, &moved);
        dot(&moved, &self.here.gradient) - 0.5 * dot(&moved, &bent)
    }
}
