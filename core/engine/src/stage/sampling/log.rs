//! Files of a sampler's run: `draws.bin` grows by one record per step; `state.json` holds a state, the number of steps
//! after which it is valid, and the statistics in a record. A run that continues truncates the file to that number of
//! records.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Read as _, Write as _};
use std::path::{Path, PathBuf};

use lacuna::data::Draws;
use lacuna::data::statistics::{Kind, Statistic, Statistics};
use lacuna::plugin::sampler::State;
use lacuna::run::{Stop, files};
use lacuna_linalg::Matrix;
use serde::{Deserialize, Serialize};

/// File of the records.
pub(super) const DRAWS: &str = "draws.bin";
/// File of the checkpoint.
pub(super) const STATE: &str = "state.json";

/// A state and the number of steps after which it is valid.
#[derive(Serialize, Deserialize)]
pub(super) struct Checkpoint {
    pub step: usize,
    /// Hash of the inputs of the chain and of the program and plugins that made it; no others may continue it.
    #[serde(default)]
    pub inputs: String,
    pub state: State,
    #[serde(default)]
    pub(super) statistics: Vec<(String, Kind)>,
    /// Number of steps after which the run ends or decides to go on.
    #[serde(default)]
    pub planned: usize,
}

/// Size of a record: the values and the acceptance of each chain at one step.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    pub chains: usize,
    pub dimension: usize,
    /// Number of statistics.
    pub told: usize,
}

impl Shape {
    /// Number of values of a chain in one step: point, log density and statistics.
    pub fn numbers(self) -> usize {
        self.dimension + 1 + self.told
    }

    /// Number of bytes of one step: the values and the acceptance of each chain.
    pub fn bytes(self) -> usize {
        self.chains * (8 * self.numbers() + 1)
    }

    /// Points (`chains x dimension`) and log densities in a record.
    pub fn points(self, record: &[u8]) -> (Matrix, Vec<f64>) {
        let point = |c: usize, j: usize| number(record, 8 * (c * self.numbers() + j));
        let points = Matrix::from_fn(self.chains, self.dimension, point);
        (points, (0..self.chains).map(|c| point(c, self.dimension)).collect())
    }
}

fn number(bytes: &[u8], at: usize) -> f64 {
    let mut word = [0; 8];
    word.copy_from_slice(&bytes[at..at + 8]);
    f64::from_le_bytes(word)
}

/// Records of a run.
pub(super) struct Read {
    /// Draws, without names.
    pub draws: Draws,
    /// Acceptance rate of each chain.
    pub acceptance: Vec<f64>,
    /// Statistics that the sampler reported for each step.
    pub statistics: Statistics,
}

/// The file of draws.
pub(super) struct Log {
    path: PathBuf,
    state_path: PathBuf,
    inputs: String,
    file: BufWriter<File>,
    chains: usize,
    dimension: usize,
    statistics: Vec<(String, Kind)>,
}

/// Names and kinds of statistics.
fn names(statistics: &[Statistic]) -> Vec<(String, Kind)> {
    statistics.iter().map(|one| (one.name.clone(), one.kind)).collect()
}

impl Log {
    pub fn open(folder: &Path, chains: usize, dimension: usize) -> Result<Self, Stop> {
        let path = folder.join(DRAWS);
        let open = OpenOptions::new().create(true).append(true).open(&path);
        let file = BufWriter::new(open.map_err(|error| files::cannot_write(&path, &error))?);
        let (state_path, statistics) = (folder.join(STATE), Vec::new());
        let inputs = lacuna_run::inputs_of(folder);
        Ok(Self { path, state_path, inputs, file, chains, dimension, statistics })
    }

    fn shape(&self) -> Shape {
        Shape { chains: self.chains, dimension: self.dimension, told: self.statistics.len() }
    }

    /// Number of bytes of one step.
    fn record(&self) -> usize {
        self.shape().bytes()
    }

    /// Reads the last checkpoint and truncates the file to it; without a checkpoint the file is emptied. `told` returns
    /// the statistics of a state.
    pub fn resume(
        &mut self,
        told: impl Fn(&State) -> Vec<Statistic>,
    ) -> Result<Option<Checkpoint>, Stop> {
        let length = fs::metadata(&self.path).map_or(0, |m| m.len());
        let checkpoint: Option<Checkpoint> = files::read_json(&self.state_path).ok();
        if let Some(checkpoint) = &checkpoint {
            self.statistics.clone_from(&checkpoint.statistics);
        }
        let fits = |c: &Checkpoint| {
            let needed = (c.step * self.record()) as u64;
            let ours = c.inputs == self.inputs && c.state.points.columns() == self.dimension;
            ours && needed <= length && names(&told(&c.state)) == c.statistics
        };
        let checkpoint = checkpoint.filter(fits);
        let kept = checkpoint.as_ref().map_or(0, |c| c.step * self.record());
        let cut = self.file.get_ref().set_len(kept as u64);
        cut.map_err(|error| files::cannot_write(&self.path, &error))?;
        Ok(checkpoint)
    }

    /// Begins a run whose steps have these statistics.
    pub fn begin(&mut self, statistics: &[Statistic]) {
        self.statistics = names(statistics);
    }

    pub fn append(&mut self, state: &State, statistics: &[Statistic]) -> Result<(), Stop> {
        if names(statistics) != self.statistics {
            return Err(Stop::new("the sampler reports other statistics at this step than before"));
        }
        let mut write = || -> io::Result<()> {
            let chains = state.points.iter_rows().zip(&state.log_density).enumerate();
            for (chain, (point, density)) in chains {
                let told = statistics.iter().map(|one| &one.values[chain]);
                for value in point.iter().chain([density]).chain(told) {
                    self.file.write_all(&value.to_le_bytes())?;
                }
            }
            let accepted: Vec<u8> = state.accepted.iter().map(|&a| u8::from(a)).collect();
            self.file.write_all(&accepted)
        };
        write().map_err(|error| files::cannot_write(&self.path, &error))
    }

    /// Writes a state, valid after `step` of `planned` steps.
    pub fn checkpoint(&mut self, step: usize, planned: usize, state: &State) -> Result<(), Stop> {
        let flushed = self.file.flush().and_then(|()| self.file.get_ref().sync_data());
        flushed.map_err(|error| files::cannot_write(&self.path, &error))?;
        let (inputs, statistics) = (self.inputs.clone(), self.statistics.clone());
        let checkpoint = Checkpoint { step, inputs, state: state.clone(), statistics, planned };
        files::write_json(&self.state_path, &checkpoint)
    }

    /// Reads the records of the first steps.
    pub fn read(&self, steps: usize) -> Result<Read, Stop> {
        let (chains, d, record) = (self.chains, self.dimension, self.record());
        let mut bytes = Vec::with_capacity(steps * record);
        let file = File::open(&self.path).map_err(|e| files::cannot_read(&self.path, &e))?;
        let taken = file.take((steps * record) as u64).read_to_end(&mut bytes);
        taken.map_err(|e| files::cannot_read(&self.path, &e))?;
        if bytes.len() != steps * record {
            return Err(Stop::new(format!("{} has the wrong length", self.path.display())));
        }
        let shape = self.shape();
        let mut records = Vec::with_capacity(steps);
        let mut moves = vec![0_u32; chains];
        for step in 0..steps {
            let own = &bytes[step * record..(step + 1) * record];
            records.push(shape.points(own));
            for (c, count) in moves.iter_mut().enumerate() {
                *count += u32::from(own[8 * chains * shape.numbers() + c]);
            }
        }
        let acceptance = moves.iter().map(|&m| f64::from(m) / steps.max(1) as f64).collect();
        let mut values = Vec::with_capacity(self.statistics.len() * chains * steps);
        for s in 0..self.statistics.len() {
            for c in 0..chains {
                let at = |step| step * record + 8 * (c * shape.numbers() + d + 1 + s);
                values.extend((0..steps).map(|step| number(&bytes, at(step))));
            }
        }
        let names = self.statistics.clone();
        let draws = Draws::from_steps(vec![String::new(); d], &records);
        Ok(Read { draws, acceptance, statistics: Statistics { names, chains, steps, values } })
    }
}
