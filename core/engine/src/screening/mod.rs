//! Screening: which inputs matter for the responses of the runs, without a surrogate.
//!
//! - If consecutive runs differ in one input each (a design of trajectories): the **elementary effects**, their mean
//!   absolute value `mu*` and their standard deviation `sigma` (Morris, Technometrics 33 (1991) 161; Campolongo,
//!   Cariboni and Saltelli, Environmental Modelling and Software 22 (2007) 1509).
//! - Otherwise: the **Hilbert-Schmidt independence criterion** of each input and the response, with the p-value of a
//!   test of independence (Gretton et al., Advances in Neural Information Processing Systems 20 (2008) 585).
//! - If the derivatives at the runs are known, the [active subspace](ActiveSubspace) as well.

mod criterion;
mod effects;
mod subspace;
#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::ops::Range;

use lacuna::math::moments::mean;
use lacuna_linalg::Matrix;

pub use self::criterion::Dependence;
pub use self::effects::ElementaryEffects;
pub use self::subspace::{ActiveSubspace, active_subspace};

/// Level of the test of independence.
pub const LEVEL: f64 = 0.05;
/// Share of the largest mean absolute elementary effect below which an input counts as without effect.
pub const SMALL: f64 = 0.05;

/// Number of values (runs times outputs) that are judged: 80 MB.
const MOST_VALUES: usize = 10_000_000;

/// Smallest number of runs for a test of independence.
const LEAST_RUNS: usize = 20;

/// Effects of the inputs as far as the runs show them, one entry per input.
#[derive(Debug, Clone, PartialEq)]
pub enum Screening {
    /// Dependence of the response on each input, from independent runs.
    Dependence(Vec<Dependence>),
    /// Elementary effects of each input, from trajectories.
    Effects(Vec<ElementaryEffects>),
}

/// Screens the inputs of runs.
///
/// `positions` are the inputs of the runs as probabilities under their designs (`runs x inputs`), in the order in
/// which the runs were placed. The outputs of one block of `blocks` have the same unit. `None` if there are too few
/// runs or no response varies.
pub fn screen(
    positions: &Matrix,
    responses: &Matrix,
    blocks: impl Iterator<Item = Range<usize>>,
) -> Option<Screening> {
    let (responses, blocks) = few_outputs(responses, blocks, MOST_VALUES);
    let scaled = scaled(&responses, blocks.into_iter())?;
    let effects = effects::elementary(positions, &scaled);
    let pairs: usize = effects.iter().map(|e| e.count).sum();
    // Trajectories have one pair per run, and as a rule a first run without one.
    if 2 * pairs > positions.rows() {
        return Some(Screening::Effects(effects));
    }
    (positions.rows() >= LEAST_RUNS)
        .then(|| Screening::Dependence(criterion::dependences(positions, &scaled)))
}

impl Screening {
    /// True for each input that has an effect, as far as the runs show.
    pub fn acts(&self) -> Vec<bool> {
        match self {
            Self::Dependence(all) => all.iter().map(|d| d.p < LEVEL).collect(),
            Self::Effects(all) => {
                let largest = all.iter().map(|e| e.mean_absolute).fold(0.0, f64::max);
                all.iter().map(|e| e.count == 0 || e.mean_absolute >= SMALL * largest).collect()
            }
        }
    }
}

/// The responses and the blocks of their outputs; evenly spaced outputs stand for all if there are more than `most` values.
fn few_outputs(
    responses: &Matrix,
    blocks: impl Iterator<Item = Range<usize>>,
    most: usize,
) -> (Cow<'_, Matrix>, Vec<Range<usize>>) {
    let step = (responses.rows() * responses.columns()).div_ceil(most).max(1);
    if step == 1 {
        return (Cow::Borrowed(responses), blocks.collect());
    }
    let (mut columns, mut few) = (Vec::new(), Vec::new());
    for block in blocks {
        let first = columns.len();
        columns.extend(block.step_by(step));
        few.push(first..columns.len());
    }
    let rows: Vec<usize> = (0..responses.rows()).collect();
    (Cow::Owned(responses.select(&rows, &columns)), few)
}

/// Divides the outputs of each block by its standard deviation over the runs, so that blocks of any unit count alike:
/// the variances of the outputs of all blocks that vary add up to one. `None` if none varies.
fn scaled(responses: &Matrix, blocks: impl Iterator<Item = Range<usize>>) -> Option<Matrix> {
    let runs = responses.rows() as f64;
    let mut scaled = Matrix::zeros(responses.rows(), responses.columns());
    let mut varying = 0.0;
    for block in blocks {
        let mut variance = 0.0;
        for j in block.clone() {
            let values = responses.column(j);
            let centre = mean(&values);
            variance += values.iter().map(|y| (y - centre).powi(2)).sum::<f64>() / runs;
            values.iter().enumerate().for_each(|(i, y)| scaled[(i, j)] = y - centre);
        }
        if !(variance > 0.0 && variance.is_finite()) {
            continue;
        }
        varying += 1.0;
        for i in 0..responses.rows() {
            scaled.row_mut(i)[block.clone()].iter_mut().for_each(|y| *y /= variance.sqrt());
        }
    }
    let size = f64::sqrt(varying);
    scaled.as_mut_slice().iter_mut().for_each(|y| *y /= size.max(1.0));
    (varying > 0.0).then_some(scaled)
}

/// Factor of each output by which [`scaled`] multiplies its deviations from the mean; zero for blocks that do not vary.
fn scales(responses: &Matrix, blocks: impl Iterator<Item = Range<usize>>) -> Option<Vec<f64>> {
    let runs = responses.rows() as f64;
    let mut scales = vec![0.0; responses.columns()];
    let mut varying = 0.0;
    for block in blocks {
        let of = |j: usize| {
            let values = responses.column(j);
            let centre = mean(&values);
            values.iter().map(|y| (y - centre).powi(2)).sum::<f64>() / runs
        };
        let variance: f64 = block.clone().map(of).sum();
        if variance > 0.0 && variance.is_finite() {
            varying += 1.0;
            scales[block].fill(variance.sqrt().recip());
        }
    }
    let size = f64::sqrt(varying).max(1.0);
    (varying > 0.0).then(|| scales.into_iter().map(|scale| scale / size).collect())
}
