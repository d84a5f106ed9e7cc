//! A sampler's steps with checkpoints: a killed run goes on with the same bits.
//!
//! `draws.bin` grows by one record a step; `state.json` says after how many steps the state in it holds. A run
//! that goes on cuts the file back to that many records. The random numbers of a step depend on its
//! number alone.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::data::Draws;
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::plugin::sampler::{Plan, State};
use crate::plugin::{Sampler, Target};
use crate::run::{Progress, Stop, files};

/// All draws of a run with what became of each step.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampled {
    /// The draws, in the target's coordinates.
    pub draws: Draws,
    /// The share of accepted moves of each chain.
    pub acceptance: Vec<f64>,
    /// How often the log density was evaluated.
    pub evaluations: u64,
}

#[derive(Serialize, Deserialize)]
struct Checkpoint {
    step: usize,
    state: State,
}

/// How soon the state is written first; each further time takes twice as long, up to [`INTERVAL`].
const FIRST: Duration = Duration::from_millis(100);
/// How often the state is written in a long run.
const INTERVAL: Duration = Duration::from_secs(2);

/// Runs a sampler for the steps of its plan, going on from a checkpoint in `folder` if there is one.
pub fn sample(
    sampler: &dyn Sampler,
    target: &dyn Target,
    names: Vec<String>,
    start: impl FnOnce() -> Result<Matrix, Stop>,
    stream: &Stream,
    folder: &Path,
    progress: &Progress<'_>,
) -> Result<Sampled, Stop> {
    let plan = sampler.plan(target.dimension());
    let mut log = Log::open(folder, plan.chains, target.dimension())?;
    let (mut step, mut state) = match log.resume()? {
        Some(checkpoint) => (checkpoint.step, checkpoint.state),
        None => (0, sampler.start(target, start()?)?),
    };
    progress.add(step as u64);
    let (mut written, mut interval) = (Instant::now(), FIRST);
    while step < plan.steps {
        sampler.step(target, &mut state, &stream.at(step as u64))?;
        log.append(&state)?;
        step += 1;
        progress.add(1);
        if written.elapsed() > interval {
            log.checkpoint(step, &state)?;
            (written, interval) = (Instant::now(), INTERVAL.min(2 * interval));
        }
    }
    log.checkpoint(step, &state)?;
    let (draws, acceptance) = log.read(names, plan)?;
    Ok(Sampled { draws, acceptance, evaluations: state.evaluations })
}

/// The file of draws.
struct Log {
    path: PathBuf,
    state_path: PathBuf,
    file: BufWriter<File>,
    chains: usize,
    dimension: usize,
}

impl Log {
    fn open(folder: &Path, chains: usize, dimension: usize) -> Result<Self, Stop> {
        let path = folder.join("draws.bin");
        let open = OpenOptions::new().create(true).append(true).open(&path);
        let file = BufWriter::new(open.map_err(|error| files::cannot_write(&path, &error))?);
        Ok(Self { state_path: folder.join("state.json"), path, file, chains, dimension })
    }

    /// Bytes of one step: point, log density and acceptance of each chain.
    fn record(&self) -> usize {
        self.chains * (8 * (self.dimension + 1) + 1)
    }

    /// The last checkpoint, with the file cut back to it; an empty file when there is none.
    fn resume(&mut self) -> Result<Option<Checkpoint>, Stop> {
        let length = fs::metadata(&self.path).map_or(0, |m| m.len());
        let checkpoint: Option<Checkpoint> = files::read_json(&self.state_path).ok();
        let fits = |c: &Checkpoint| {
            let needed = (c.step * self.record()) as u64;
            needed <= length && c.state.points.columns() == self.dimension
        };
        let checkpoint = checkpoint.filter(fits);
        let kept = checkpoint.as_ref().map_or(0, |c| c.step * self.record());
        let cut = self.file.get_ref().set_len(kept as u64);
        cut.map_err(|error| files::cannot_write(&self.path, &error))?;
        Ok(checkpoint)
    }

    fn append(&mut self, state: &State) -> Result<(), Stop> {
        let mut write = || -> io::Result<()> {
            for (point, density) in state.points.iter_rows().zip(&state.log_density) {
                for value in point.iter().chain([density]) {
                    self.file.write_all(&value.to_le_bytes())?;
                }
            }
            let accepted: Vec<u8> = state.accepted.iter().map(|&a| u8::from(a)).collect();
            self.file.write_all(&accepted)
        };
        write().map_err(|error| files::cannot_write(&self.path, &error))
    }

    fn checkpoint(&mut self, step: usize, state: &State) -> Result<(), Stop> {
        let flushed = self.file.flush().and_then(|()| self.file.get_ref().sync_data());
        flushed.map_err(|error| files::cannot_write(&self.path, &error))?;
        files::write_json(&self.state_path, &Checkpoint { step, state: state.clone() })
    }

    fn read(&self, names: Vec<String>, plan: Plan) -> Result<(Draws, Vec<f64>), Stop> {
        let mut bytes = Vec::new();
        let mut file = File::open(&self.path).map_err(|e| files::cannot_read(&self.path, &e))?;
        file.read_to_end(&mut bytes).map_err(|e| files::cannot_read(&self.path, &e))?;
        let (chains, d, record) = (self.chains, self.dimension, self.record());
        if bytes.len() != plan.steps * record {
            return Err(Stop::new(format!("{} has the wrong length", self.path.display())));
        }
        let number = |at: usize| {
            let mut word = [0; 8];
            word.copy_from_slice(&bytes[at..at + 8]);
            f64::from_le_bytes(word)
        };
        let mut steps = Vec::with_capacity(plan.steps);
        let mut moves = vec![0_u32; chains];
        for step in 0..plan.steps {
            let from = step * record;
            let point = |c: usize, j: usize| number(from + 8 * (c * (d + 1) + j));
            let points = Matrix::from_fn(chains, d, point);
            let density = (0..chains).map(|c| point(c, d)).collect();
            steps.push((points, density));
            for (c, count) in moves.iter_mut().enumerate() {
                *count += u32::from(bytes[from + 8 * chains * (d + 1) + c]);
            }
        }
        let acceptance = moves.iter().map(|&m| f64::from(m) / plan.steps.max(1) as f64).collect();
        Ok((Draws::from_steps(names, &steps), acceptance))
    }
}
