//! Evaluations of a model beside those of the design, kept in the run directory: an interrupted stage, later stages and a
//! study that asks for something else find them again. Of a model that takes the place of an emulator the slow ones are
//! kept; of derivatives at the runs of a design all.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Duration;

use lacuna::run::{Stop, files};
use serde::{Deserialize, Serialize};

/// Evaluations that take less time are repeated, unless all are kept.
const SLOW: Duration = Duration::from_secs(1);

/// Kept evaluations of a model.
pub struct Calls {
    path: PathBuf,
    /// Evaluations that take less time are not kept.
    least: Duration,
    known: Mutex<Known>,
    /// False if further evaluations stay in memory.
    writes: bool,
}

#[derive(Default)]
struct Known {
    /// Response by scenario and bits of the inputs.
    responses: BTreeMap<(usize, Vec<u64>), Vec<f64>>,
    /// The file, once something was written.
    file: Option<File>,
}

/// One line of the file.
#[derive(Serialize, Deserialize)]
struct Line {
    /// Number of the scenario.
    scenario: usize,
    /// Inputs of the model in its units.
    inputs: Vec<f64>,
    response: Vec<f64>,
}

fn key(scenario: usize, inputs: &[f64]) -> (usize, Vec<u64>) {
    (scenario, inputs.iter().map(|x| x.to_bits()).collect())
}

impl Calls {
    /// The evaluations in a file, which need not exist. A line that was cut by the end of the process is ignored.
    pub fn open(path: PathBuf) -> Self {
        Self::with(path, SLOW)
    }

    /// Like [`Calls::open`]; all evaluations are kept.
    pub fn of_all(path: PathBuf) -> Self {
        Self::with(path, Duration::ZERO)
    }

    fn with(path: PathBuf, least: Duration) -> Self {
        let text = fs::read(&path).unwrap_or_default();
        let lines = text.split(|byte| *byte == b'\n');
        let responses = lines
            .filter_map(|line| serde_json::from_slice::<Line>(line).ok())
            .map(|line| (key(line.scenario, &line.inputs), line.response))
            .collect();
        Self { path, least, known: Mutex::new(Known { responses, file: None }), writes: true }
    }

    /// The same, except that further evaluations stay in memory: another process appends to the file.
    pub fn in_memory(self) -> Self {
        Self { writes: false, ..self }
    }

    /// The response to a scenario for some inputs, if it is known.
    pub fn response(&self, scenario: usize, inputs: &[f64]) -> Option<Vec<f64>> {
        let known = self.known.lock().ok()?;
        // A fast model asks at every evaluation and never has any.
        if known.responses.is_empty() {
            return None;
        }
        known.responses.get(&key(scenario, inputs)).cloned()
    }

    /// Keeps a response that took this time.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn note(
        &self,
        scenario: usize,
        inputs: &[f64],
        response: &[f64],
        taken: Duration,
    ) -> Result<(), Stop> {
        if taken < self.least {
            return Ok(());
        }
        let Ok(mut known) = self.known.lock() else { return Ok(()) };
        let line = Line { scenario, inputs: inputs.to_vec(), response: response.to_vec() };
        let text = serde_json::to_string(&line)
            .map_err(|error| Stop::new(format!("cannot note a response: {error}")))?;
        let failed = |error: std::io::Error| files::cannot_write(&self.path, &error);
        if self.writes {
            let file = match &mut known.file {
                Some(file) => file,
                none => none.insert(self.created().map_err(failed)?),
            };
            writeln!(file, "{text}").map_err(failed)?;
        }
        known.responses.insert(key(scenario, inputs), line.response);
        Ok(())
    }

    /// The file, whose next line is a new one.
    fn created(&self) -> std::io::Result<File> {
        if let Some(folder) = self.path.parent() {
            fs::create_dir_all(folder)?;
        }
        let cut = fs::read(&self.path).is_ok_and(|old| !old.is_empty() && !old.ends_with(b"\n"));
        let mut file = OpenOptions::new().create(true).append(true).open(&self.path)?;
        if cut {
            writeln!(file)?;
        }
        Ok(file)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn slow_responses_are_found_again_bit_by_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("calls").join("a.jsonl");
        let (points, response) =
            ([[0.1, 1e-300], [0.1 + f64::EPSILON, 1e-300]], [1.0 / 3.0, 2e300]);
        let calls = Calls::open(path.clone());
        calls.note(0, &points[0], &response, SLOW / 2).unwrap();
        assert!(!path.exists(), "nothing was slow");
        calls.note(1, &points[0], &response, SLOW).unwrap();
        assert_eq!(calls.response(1, &points[0]).unwrap(), response);
        // The process ends within a line.
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, format!("{text}{}", &text[..text.len() / 2])).unwrap();
        let calls = Calls::open(path.clone());
        calls.note(0, &points[1], &response, 2 * SLOW).unwrap();
        let calls = Calls::open(path);
        assert_eq!(calls.response(1, &points[0]).unwrap(), response);
        assert_eq!(calls.response(0, &points[1]).unwrap(), response);
        assert_eq!(calls.response(0, &points[0]), None);
    }
}
