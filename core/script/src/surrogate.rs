//! Surrogates in Python.

use lacuna::math::random::Stream;
use lacuna::matrix::Matrix;
use lacuna::plugin::surrogate::{Emulator, FitError, Surrogate, Training};
use lacuna::plugin::{Fact, Forward};
use lacuna::run::files::hash;
use lacuna::run::{Progress, Stop};
use lacuna_abi::Refusal;
use lacuna_abi::check::{finite_only, numbers_only, shaped};
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::object::{Call, Object, Plugin, answer, matrices, matrix, row};

/// Runs from which errors can be estimated by leaving some out.
const LEAST: usize = 3;

/// A fitted surrogate.
struct Fitted {
    object: Object,
    kept: Kept,
    has_variance: bool,
}

/// Parts of an emulator that are kept, with what Python makes of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Kept {
    dimension: usize,
    outputs: usize,
    /// A point of the training runs.
    point: Vec<f64>,
    /// Distance of the largest from the smallest value of each parameter over the runs.
    ranges: Vec<f64>,
    fit_error: FitError,
    /// SHA-256 of the pickle.
    sha256: String,
    /// The emulator, pickled by Python.
    #[serde(skip)]
    pickle: Vec<u8>,
}

impl Kept {
    /// A line of JSON, and the pickle.
    fn bytes(&self) -> Result<Vec<u8>, serde_json::Error> {
        let mut bytes = serde_json::to_vec(self)?;
        bytes.push(b'\n');
        bytes.extend(&self.pickle);
        Ok(bytes)
    }

    fn of(bytes: &[u8]) -> Result<Self, Refusal> {
        let end = bytes.iter().position(|byte| *byte == b'\n').unwrap_or(bytes.len());
        let kept: Self = serde_json::from_slice(&bytes[..end])?;
        let pickle = bytes.get(end + 1..).unwrap_or_default().to_vec();
        if hash(&pickle) != kept.sha256 {
            return Err(Refusal::stop("the emulator that was kept is damaged"));
        }
        Ok(Self { pickle, ..kept })
    }
}

#[derive(Deserialize)]
struct MadeAbout {
    has: Vec<String>,
}

impl Plugin {
    fn fitted(&self, runs: &Training<'_>, stream: &Stream) -> Result<Fitted, Refusal> {
        let count = runs.points.rows();
        if count < LEAST || runs.responses.rows() != count {
            let responses = runs.responses.rows();
            let message = format!("there are {count} runs with {responses} responses");
            return Err(Refusal::stop(format!("{message}, expected {LEAST} or more of each")));
        }
        finite_only("the runs", runs.points.as_slice())?;
        finite_only("the runs", runs.responses.as_slice())?;
        let about = json!({
            "parameters": runs.parameters, "layouts": runs.layouts.blocks, "key": stream.key(),
        });
        let given = [runs.points, runs.responses];
        let message = self.0.ask(&Call::new("fit", &given).about(about))?;
        let pickle = message.bytes.clone();
        let [relative, residuals] = matrices(message)?;
        let (count, outputs) = (runs.responses.rows(), runs.responses.columns());
        shaped("fit", &relative, 1, outputs)?;
        shaped("fit", &residuals, count, outputs)?;
        numbers_only("fit", residuals.as_slice())?;
        let fit_error = FitError { relative: relative.into_vec(), residuals };
        self.brought(Kept {
            dimension: runs.points.columns(),
            outputs,
            point: runs.points.row(0).to_vec(),
            ranges: ranges(runs.points),
            fit_error,
            sha256: hash(&pickle),
            pickle,
        })
    }

    /// The emulator that was kept.
    fn brought(&self, kept: Kept) -> Result<Fitted, Refusal> {
        let about = json!({ "outputs": kept.outputs, "point": kept.point });
        let call = Call { bytes: &kept.pickle, ..Call::new("load", &[]).about(about) };
        let (object, made) = self.0.make(&call)?;
        let MadeAbout { has } = answer(&made)?;
        let has_variance = has.iter().any(|name| name == "variance");
        Ok(Fitted { object, kept, has_variance })
    }
}

fn ranges(points: &Matrix) -> Vec<f64> {
    let bound = |j: usize, pick: fn(f64, f64) -> f64| {
        points.iter_rows().map(|row| row[j]).reduce(pick).unwrap_or_default()
    };
    (0..points.columns()).map(|j| bound(j, f64::max) - bound(j, f64::min)).collect()
}

impl Surrogate for Plugin {
    fn fit(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Box<dyn Emulator>, Stop> {
        let fitted = self.0.or_stop(self.fitted(training, stream))?;
        progress.add(training.responses.columns() as u64);
        Ok(Box::new(fitted))
    }

    fn load(&self, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop> {
        Ok(Box::new(self.0.or_stop(Kept::of(bytes).and_then(|kept| self.brought(kept)))?))
    }
}

impl Fitted {
    fn numbers(
        &self,
        what: &'static str,
        points: &Matrix,
        (rows, columns): (usize, usize),
    ) -> Matrix {
        let asked = || {
            let given = [points];
            let about = json!({ "ranges": self.kept.ranges });
            matrix(what, self.object.ask(&Call::new(what, &given).about(about))?, rows, columns)
        };
        self.object.or_fault(asked(), || Matrix::from_fn(rows, columns, |_, _| f64::NAN))
    }
}

impl Forward for Fitted {
    fn dimension(&self) -> usize {
        self.kept.dimension
    }

    fn outputs(&self) -> usize {
        self.kept.outputs
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        self.numbers("mean", points, (points.rows(), self.kept.outputs))
    }

    fn variance(&self, points: &Matrix) -> Option<Matrix> {
        let shape = (points.rows(), self.kept.outputs);
        self.has_variance.then(|| self.numbers("variance", points, shape))
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        self.numbers("jacobian", &row(point), (self.kept.outputs, point.len()))
    }

    fn failure(&self) -> Option<String> {
        self.object.fault().said().map(str::to_owned)
    }
}

impl Emulator for Fitted {
    fn fit_error(&self) -> &FitError {
        &self.kept.fit_error
    }

    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }

    fn save(&self) -> Result<Vec<u8>, Stop> {
        self.kept
            .bytes()
            .map_err(|error| Stop::new(format!("an emulator cannot be written: {error}")))
    }
}
