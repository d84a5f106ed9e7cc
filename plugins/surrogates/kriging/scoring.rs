//! Scoring: maximisation by the information of the likelihood.

use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, multiply_vector};

use super::likelihood::{Scored, Slopes};

/// Longest steps in the logarithms of a length scale and of the nugget; the nugget often has far to go.
const LONGEST: [f64; 2] = [1.0, 10.0];
/// Maximum number of likelihood evaluations, which dominate the cost.
const MOST: usize = 40;
/// Number of last steps that correct the information.
const MEMORY: usize = 4;

/// Returns the local maximum reached from a point, and whether the search converged; `None` if the point has no
/// likelihood. The search ends where no step is predicted to gain more than `gain` in log-likelihood.
///
/// The steps are those of Newton's method with the average information in place of the Hessian (Gilmour, Thompson and
/// Cullis 1995), which costs little more than the gradient. The response of a simulator is not a realisation of the
/// process, so that the information is wrong by factors; the changes of the gradient along the last steps correct it
/// (BFGS). Steps are damped (Levenberg-Marquardt) until the likelihood increases; coordinates that are pressed
/// against a bound stay there.
pub fn score(problem: &impl Scored, start: &[f64], gain: f64) -> Option<(Vec<f64>, bool)> {
    let bounds = problem.bounds();
    let mut point = start.to_vec();
    let mut here = problem.slopes(&point)?;
    let mut steps: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
    let mut damping = 0.0;
    for _ in 0..MOST {
        let curvature = corrected(&here.information, &steps);
        let free = free(&point, &here.gradient, &bounds);
        let longest = |j: usize| LONGEST[usize::from(j == problem.length_scales())];
        let place = Place { point: &point, here: &here, curvature: &curvature, free: &free };
        let Some(next) = place.step(&bounds, damping, longest) else { break };
        let promise = place.promise(&next);
        if promise < gain {
            // A step limited by a bound says nothing about what the other coordinates could gain.
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

/// Returns the coordinates that no bound holds.
fn free(point: &[f64], gradient: &[f64], bounds: &[(f64, f64)]) -> Vec<usize> {
    let held = |j: usize| {
        let (low, high) = bounds[j];
        (point[j] <= low && gradient[j] <= 0.0) || (point[j] >= high && gradient[j] >= 0.0)
    };
    (0..point.len()).filter(|&j| !held(j)).collect()
}

/// Corrects the information by the curvature along the last steps, where that is positive.
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

/// Quadratic model of the likelihood around a point.
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

    /// Returns the end of the damped step, within the bounds.
    fn step(
        &self,
        bounds: &[(f64, f64)],
        damping: f64,
        longest: impl Fn(usize) -> f64,
    ) -> Option<Vec<f64>> {
        let count = self.free.len();
        // The floor keeps the step finite if there is hardly any curvature.
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

    /// Returns the gain that the quadratic model predicts at another point.
    fn promise(&self, next: &[f64]) -> f64 {
        let moved: Vec<f64> = next.iter().zip(self.point).map(|(a, b)| a - b).collect();
        let bent = multiply_vector(self.curvature, &moved);
        dot(&moved, &self.here.gradient) - 0.5 * dot(&moved, &bent)
    }
}
