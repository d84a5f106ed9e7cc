//! Leave-one-out predictions of many data, estimated from a random sample of them.

use std::collections::BTreeSet;

use lacuna::diagnose::leave_one_out::{Approximation, LeaveOneOut, Left};
use lacuna::diagnose::pareto;
use lacuna::math::moments::mean;
use lacuna::math::random::{Stream, below};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use rayon::prelude::*;

use crate::stage::pieces::Pieces;
use crate::stage::predictions::{self, Chosen, Predicting};
use crate::stage::{curves, predict};
use crate::study::Study;

/// Number of data above which a sample of them is predicted.
pub(super) const MANY: usize = 250_000;

/// Number of data of a sample.
pub(super) const SIZE: usize = 25_000;

/// Number of data whose approximations are held together.
const HELD: usize = 1 << 24;

/// Number of parts in which the approximations of more data are made.
const PARTS: usize = 64;

/// The predictions; `None` if the discrepancy has no densities of left-out data.
pub(super) fn left_out(
    study: &Study,
    p: &Predicting<'_>,
    chosen: &Chosen,
    responses: Option<&[Vec<f64>]>,
    pieces: &mut Pieces<'_>,
) -> Result<Option<LeaveOneOut>, Stop> {
    let sample = sample(p.data.count(), SIZE);
    let densities = predictions::pointwise_at(study, p, chosen, responses, &sample, pieces)?;
    let Some(densities) = densities else { return Ok(None) };
    let left = |i: usize| Left::of(&densities.column(i), chosen.efficiency);
    let left = (0..sample.len()).into_par_iter().map(left).collect();
    let whole = approximation(study, p, &chosen.points, &sample);
    Ok(whole.map(|whole| LeaveOneOut::from_sample(left, &whole, pareto::limit(densities.rows()))))
}

/// Indices of data drawn without replacement, in increasing order (Floyd's algorithm: Bentley and Floyd, Communications of the
/// ACM 30 (1987) 754). They depend on the numbers alone, so that studies of the same data have the same sample.
fn sample(all: usize, size: usize) -> Vec<usize> {
    let mut rng = Stream::root(0).named("left-out sample").generator();
    let mut chosen = BTreeSet::new();
    for last in all.saturating_sub(size)..all {
        let index = below(&mut rng, last + 1);
        if !chosen.insert(index) {
            chosen.insert(last);
        }
    }
    chosen.into_iter().collect()
}

/// Log density of each datum given all others at the mean of the points.
fn approximation(
    study: &Study,
    p: &Predicting<'_>,
    points: &Matrix,
    sample: &[usize],
) -> Option<Approximation> {
    let centre: Vec<f64> = (0..points.columns()).map(|j| mean(&points.column(j))).collect();
    let hyper = &centre[centre.len() - p.likelihood.hyperparameters().len()..];
    let row = Matrix::from_vec(1, centre.len(), centre.clone());
    let response = &predict::responses(study, p.forward, &row)[0];
    let data = p.data.count();
    let size = if data <= HELD { data } else { data.div_ceil(PARTS) };
    let mut whole = Approximation::default();
    let mut firsts = curves::beginnings(p.data);
    let mut sample = sample.iter().copied().peekable();
    for begin in (0..data).step_by(size.max(1)) {
        let densities = if size == data {
            p.likelihood.left_out(response, hyper)?
        } else {
            let part: Vec<usize> = (begin..data.min(begin + size)).collect();
            p.likelihood.left_out_at(response, hyper, &part)?
        };
        for (i, density) in densities.into_iter().enumerate() {
            let is_sampled = sample.next_if_eq(&(begin + i)).is_some();
            // Any number approximates: the sample corrects for it.
            let density = if density.is_finite() { density } else { 0.0 };
            whole.add(density, firsts.next().unwrap_or(false), is_sampled);
        }
    }
    Some(whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_spread_over_all_data_without_repetition() {
        let found = sample(1_000_000, 10_000);
        assert_eq!(found.len(), 10_000);
        assert!(found.windows(2).all(|pair| pair[0] < pair[1]) && found[9999] < 1_000_000);
        // The mean of a sample of uniform numbers, four standard errors.
        let share = found.iter().map(|&i| i as f64 / 1e6).sum::<f64>() / 1e4;
        assert!((share - 0.5).abs() < 4.0 / (12.0_f64 * 1e4).sqrt(), "{share}");
        assert_eq!(sample(5, 5), [0, 1, 2, 3, 4]);
        assert_eq!(sample(3, 5), [0, 1, 2]);
    }
}
