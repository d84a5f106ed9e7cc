//! Placement of the next runs.

use lacuna::data::Draws;
use lacuna::math::random::{Stream, uniform};
use lacuna::math::{moments, sobol};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use crate::stage::emulated::Emulated;

/// Number of candidates per chosen point: half of them draws from the posterior, half an even cover.
const CANDIDATES: usize = 40;
/// Number of nearest runs from which the error at a candidate is estimated.
const NEIGHBOURS: usize = 5;

/// Problem of placing new points.
pub(super) struct Sought<'a> {
    /// The emulator so far.
    pub learned: &'a Emulated,
    /// Draws of the posterior so far.
    pub draws: &'a Draws,
    /// Region of the points.
    pub place: &'a [(f64, f64)],
    /// Number of points.
    pub count: usize,
}

/// Points in the region, one per row, in the order in which they were chosen.
pub(super) fn points(sought: &Sought<'_>, stream: &Stream) -> Result<Matrix, Stop> {
    let Sought { learned, draws, place, count } = *sought;
    let candidates = candidates(draws, place, CANDIDATES * count, stream);
    let unit = |point: &[f64]| -> Vec<f64> {
        place.iter().zip(point).map(|(&(low, high), x)| (x - low) / (high - low)).collect()
    };
    let scaled: Vec<Vec<f64>> = candidates.iter_rows().map(unit).collect();
    let runs: Vec<Vec<f64>> = learned.data.value.runs()?.points.iter_rows().map(unit).collect();
    let errors = errors(learned, &candidates, &scaled, &unit);
    let nearest = |x: &Vec<f64>| runs.iter().map(|r| distance(x, r)).fold(f64::INFINITY, f64::min);
    let mut clearance: Vec<f64> = scaled.iter().map(nearest).collect();
    let mut chosen = Matrix::zeros(0, place.len());
    for _ in 0..count {
        let score = |i: usize| errors[i] * clearance[i];
        let best = (0..scaled.len()).reduce(|a, b| if score(b) > score(a) { b } else { a });
        let Some(best) = best else { break };
        chosen.push_row(candidates.row(best));
        for (c, x) in clearance.iter_mut().zip(&scaled) {
            *c = c.min(distance(x, &scaled[best]));
        }
    }
    Ok(chosen)
}

/// Candidates in the region: draws of the posterior, then an even cover.
pub(super) fn candidates(
    draws: &Draws,
    place: &[(f64, f64)],
    count: usize,
    stream: &Stream,
) -> Matrix {
    let mut points = Matrix::zeros(0, place.len());
    let all = draws.points();
    let half = (count / 2).min(all.rows());
    for k in 0..half {
        let row = all.row((2 * k + 1) * all.rows() / (2 * half));
        let inside = row.iter().zip(place).map(|(x, &(low, high))| x.clamp(low, high));
        points.push_row(&inside.collect::<Vec<_>>());
    }
    // The cover is shifted randomly, so that rounds do not repeat each other.
    let mut rng = stream.generator();
    let shift: Vec<f64> = place.iter().map(|_| uniform(&mut rng)).collect();
    let within = place.len() <= sobol::LARGEST_DIMENSION;
    for k in 0..count - half {
        let even = if within {
            sobol::point(k as u32, place.len())
        } else {
            place.iter().map(|_| uniform(&mut rng)).collect()
        };
        let moved = even.iter().zip(&shift).map(|(u, s)| (u + s).fract());
        let row = moved.zip(place).map(|(u, &(low, high))| low + u * (high - low));
        points.push_row(&row.collect::<Vec<_>>());
    }
    points
}

/// Error of the emulator at each candidate, root mean square over the outputs: as the emulator states it, otherwise
/// that of the nearest runs, weighted by the inverse of their distance.
fn errors(
    learned: &Emulated,
    candidates: &Matrix,
    scaled: &[Vec<f64>],
    unit: &impl Fn(&[f64]) -> Vec<f64>,
) -> Vec<f64> {
    if let Some(variance) = learned.emulator.variance(candidates) {
        return variance.iter_rows().map(|row| moments::mean(row).sqrt()).collect();
    }
    let fitted = &learned.fitted.value;
    let problem: Vec<(Vec<f64>, f64)> = fitted
        .sample_points
        .iter_rows()
        .zip(fitted.samples().iter_rows())
        .map(|(point, errors)| {
            let squares: Vec<f64> = errors.iter().map(|e| e * e).collect();
            (unit(point), moments::mean(&squares))
        })
        .collect();
    let error = |x: &Vec<f64>| {
        let mut near: Vec<(f64, f64)> =
            problem.iter().map(|(point, square)| (distance(x, point), *square)).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut sum, mut weights) = (0.0, 0.0);
        for (distance, square) in near.iter().take(NEIGHBOURS) {
            // The small distance keeps the weight finite at a run itself.
            let weight = 1.0 / (distance + 1e-6);
            sum += weight * square;
            weights += weight;
        }
        (sum / weights).sqrt()
    };
    scaled.iter().map(error).collect()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt()
}
