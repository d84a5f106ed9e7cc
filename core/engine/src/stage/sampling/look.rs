//! A look at the draws of a run that may still be sampling, from another process: nothing is locked or written.

use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::Path;

use lacuna::data::Draws;
use lacuna::run::files;

use super::log::{Checkpoint, Shape};

/// Draws of a run up to its last checkpoint.
#[derive(Debug, Clone, PartialEq)]
pub struct Look {
    /// Number of steps at the checkpoint.
    pub steps: usize,
    /// Number of steps after which the run ends, or decides whether to go on; zero if it is not known.
    pub planned: usize,
    /// Interval between the steps in `draws`; 1 if it has every step.
    pub every: usize,
    /// Draws in the sampler's coordinates, without names.
    pub draws: Draws,
    /// Number of evaluations of the log density.
    pub evaluations: u64,
}

/// Reads the draws in a folder of the stage: every step, or evenly spaced ones if they are more than `most` numbers.
///
/// `None` if there is no checkpoint, or if the draws are not those of the checkpoint, as in the moment in which another
/// attempt begins. Steps after the checkpoint are not read: the last of them may be incomplete.
pub fn look(folder: &Path, most: usize) -> Option<Look> {
    let checkpoint: Checkpoint = files::read_json(&folder.join(super::log::STATE)).ok()?;
    let Checkpoint { step: steps, planned, state, statistics, inputs } = checkpoint;
    let (chains, dimension) = (state.points.rows(), state.points.columns());
    let shape = Shape { chains, dimension, told: statistics.len() };
    if inputs != lacuna_run::inputs_of(folder) || chains == 0 || dimension == 0 {
        return None;
    }
    let file = File::open(folder.join(super::log::DRAWS)).ok()?;
    // A damaged checkpoint can state any number of steps: they are read where the file has them.
    let whole = steps.checked_mul(shape.bytes())?;
    if whole as u64 > file.metadata().ok()?.len() {
        return None;
    }
    let every = (steps * chains * dimension).div_ceil(most.max(1)).max(1);
    let mut file = BufReader::new(file);
    let mut record = vec![0; shape.bytes()];
    let between = i64::try_from((every - 1) * shape.bytes()).ok()?;
    let mut records = Vec::with_capacity(steps.div_ceil(every));
    for _ in (0..steps).step_by(every) {
        file.read_exact(&mut record).ok()?;
        records.push(shape.points(&record));
        file.seek_relative(between).ok()?;
    }
    let mut draws = Draws::from_steps(vec![String::new(); dimension], &records);
    // Without steps there are chains all the same.
    draws.chains = chains;
    Some(Look { steps, planned, every, draws, evaluations: state.evaluations })
}
