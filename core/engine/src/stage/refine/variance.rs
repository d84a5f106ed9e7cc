//! Placement of the next runs by what they do to the posterior.
//!
//! The emulator's error at a point is normal, so that the posterior density there is a random number `p`. With the data
//! in units of their noise, residual `e` of the emulator's mean and covariance `S` of its error, `E p` is the normal
//! density `N(e; I + S)`. A further run at a candidate changes the mean by a normal number of covariance `F` and the
//! covariance to `S - F`; the expectation of `(E p)²` over the result of the run is, without constant factors,
//! `N(e; (I + S + F) / 2) |I + S - F|^-1/2`, and the expected variance that the run leaves is smaller by as much as this
//! is greater (Sürer, Plumlee and Wild, Technometrics 66 (2024) 162, theorem 1: EIVAR). Integrals over the parameters are
//! means over draws of the present posterior, weighted by `1 / E p`.

use lacuna::math::moments;
use lacuna::math::random::Stream;
use lacuna::plugin::surrogate::Processes;
use lacuna::run::Stop;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, thin_qr, transposed_multiply_vector};
use rayon::prelude::*;

use super::choose::{Sought, candidates};

/// Number of draws over which the variance is integrated.
const REFERENCES: usize = 150;
/// Numbers of candidates: at least the first, and the second for each point.
const CANDIDATES: [usize; 2] = [120, 3];
/// Smallest variance of a component of the emulator's error, in units of the data's noise, that counts.
const LEAST: f64 = 1e-4;

/// Points in the region, one per row, in the order in which they were chosen; `None` if the emulator does not know the
/// covariance of its errors, or if they are negligible.
pub(super) fn points(
    sought: &Sought<'_>,
    noise: &[f64],
    stream: &Stream,
) -> Result<Option<Matrix>, Stop> {
    let Some(processes) = sought.learned.emulator.processes() else { return Ok(None) };
    let number = CANDIDATES[0].max(CANDIDATES[1] * sought.count);
    let candidates = candidates(sought.draws, sought.place, number, stream);
    let all = sought.draws.points();
    let references = REFERENCES.min(all.rows());
    let d = sought.place.len();
    let mut points = Matrix::zeros(0, d);
    for k in 0..references {
        let row = all.row(k * all.rows() / references)[..d].iter().zip(sought.place);
        points.push_row(&row.map(|(x, &(low, high))| x.clamp(low, high)).collect::<Vec<_>>());
    }
    let places: Vec<usize> = (references..references + candidates.rows()).collect();
    candidates.iter_rows().for_each(|row| points.push_row(row));
    let measured = sought.learned.data.value.measured.as_ref();
    let measured = measured.ok_or_else(|| Stop::new("the study has no measurements"))?;
    let data: Vec<f64> = measured.likelihood.summaries().iter().map(|s| s.mean).collect();
    let some = points.select_rows(&(0..references).collect::<Vec<_>>());
    let means = sought.learned.forward().mean(&some);
    let Some(mut state) = State::of(processes, &points, (&data, noise), &means)? else {
        return Ok(None);
    };
    let mut chosen = Vec::new();
    for _ in 0..sought.count {
        let gains: Vec<f64> = places.par_iter().map(|&c| state.gain(c)).collect();
        let best = (0..gains.len()).reduce(|a, b| if gains[b] > gains[a] { b } else { a });
        let Some(best) = best else { break };
        chosen.push(places[best]);
        state.condition(places[best]);
    }
    Ok(Some(points.select_rows(&chosen)))
}

/// The emulator's errors among references and candidates, in units of the data's noise.
struct State {
    /// Covariance of each component among all points.
    covariances: Vec<Matrix>,
    /// Variance of the noise of a new run in each component.
    noise: Vec<f64>,
    /// Directions of the components in the space that they span, `dimensions x components`.
    directions: Matrix,
    /// Residual of each reference in that space, `references x dimensions`.
    residuals: Matrix,
    /// Half of the sum of squares of each residual outside that space.
    outside: Vec<f64>,
}

impl State {
    /// The state for data with a variance of their mean (NaN where nothing was measured) and the emulator's means at
    /// the references, which are the first points; `None` if no component of the error counts.
    fn of(
        processes: &dyn Processes,
        points: &Matrix,
        (data, variance): (&[f64], &[f64]),
        means: &Matrix,
    ) -> Result<Option<Self>, Stop> {
        let outputs: Vec<usize> =
            (0..data.len()).filter(|&i| variance[i].is_finite() && variance[i] > 0.0).collect();
        let sd: Vec<f64> = outputs.iter().map(|&i| variance[i].sqrt()).collect();
        let all = processes.directions();
        let covariances = processes.covariances(points);
        let size = |k: usize| -> f64 {
            let column = outputs.iter().zip(&sd).map(|(&i, sd)| (all[(k, i)] / sd).powi(2));
            let widest = (0..means.rows()).map(|i| covariances[k][(i, i)]).fold(0.0, f64::max);
            widest * column.sum::<f64>()
        };
        let counted: Vec<usize> = (0..all.rows()).filter(|&k| size(k) > LEAST).collect();
        if counted.is_empty() {
            return Ok(None);
        }
        let white = Matrix::from_fn(outputs.len(), counted.len(), |i, k| {
            all[(counted[k], outputs[i])] / sd[i]
        });
        let failed = |error| Stop::new(format!("the directions of the emulator's error: {error}"));
        let span = thin_qr(&white).map_err(failed)?;
        let mut residuals = Matrix::zeros(0, span.r.rows());
        let mut outside = Vec::new();
        for mean in means.iter_rows() {
            let whole: Vec<f64> =
                outputs.iter().zip(&sd).map(|(&i, sd)| (data[i] - mean[i]) / sd).collect();
            let inside = transposed_multiply_vector(&span.q, &whole);
            outside.push(0.5 * (dot(&whole, &whole) - dot(&inside, &inside)).max(0.0));
            residuals.push_row(&inside);
        }
        // Only differences between the references matter.
        let least = outside.iter().copied().fold(f64::INFINITY, f64::min);
        for part in &mut outside {
            *part -= least;
        }
        let noise = processes.noise();
        Ok(Some(Self {
            covariances: counted.iter().map(|&k| covariances[k].clone()).collect(),
            noise: counted.iter().map(|&k| noise[k]).collect(),
            directions: span.r,
            residuals,
            outside,
        }))
    }

    /// Logarithm of the expectation of `(E p)²` after a run at point `c`, integrated over the parameters.
    fn gain(&self, c: usize) -> f64 {
        let at = |i: usize| {
            let own: Vec<f64> = self.covariances.iter().map(|all| all[(i, i)].max(0.0)).collect();
            let known = self.covariances.iter().zip(&self.noise);
            let share = known.zip(&own).map(|((all, noise), own)| {
                let total = all[(c, c)].max(0.0) + noise;
                if total > 0.0 { (all[(i, c)].powi(2) / total).min(*own) } else { 0.0 }
            });
            let known: Vec<f64> = share.collect();
            log_square(&self.directions, self.residuals.row(i), &own, &known) - self.outside[i]
        };
        let logs: Vec<f64> = (0..self.outside.len()).map(at).collect();
        moments::log_sum(logs.into_iter())
    }

    /// Conditions the errors on a run at point `c`, whose result is not yet known.
    fn condition(&mut self, c: usize) {
        for (all, noise) in self.covariances.iter_mut().zip(&self.noise) {
            let total = all[(c, c)].max(0.0) + noise;
            if total <= 0.0 {
                continue;
            }
            let column = all.column(c);
            for (i, row) in column.iter().enumerate() {
                let factor = row / total;
                all.row_mut(i).iter_mut().zip(&column).for_each(|(v, x)| *v -= factor * x);
            }
        }
    }
}

/// `log (E (E p)² / E p)` without constants, at a residual with the variances `own` of the components, of which a run
/// will make `known` known.
fn log_square(directions: &Matrix, residual: &[f64], own: &[f64], known: &[f64]) -> f64 {
    let factor = |sign: f64| {
        let p = directions.rows();
        let sum = |i: usize, j: usize| {
            let terms = own.iter().zip(known).enumerate().map(|(k, (own, known))| {
                (own + sign * known) * directions[(i, k)] * directions[(j, k)]
            });
            terms.sum::<f64>() + if i == j { 1.0 } else { 0.0 }
        };
        Cholesky::new(&Matrix::from_fn(p, p, sum))
    };
    let (Ok(wide), Ok(narrow), Ok(now)) = (factor(1.0), factor(-1.0), factor(0.0)) else {
        return f64::NEG_INFINITY;
    };
    let determinants = wide.log_determinant() + narrow.log_determinant() - now.log_determinant();
    0.5 * now.quadratic(residual) - wide.quadratic(residual) - 0.5 * determinants
}

#[cfg(test)]
mod tests;
