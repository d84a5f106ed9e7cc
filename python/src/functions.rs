//! Model, emulator and posterior of a study as functions of arrays.
//!
//! Tables pass as the bytes of their numbers, row by row, little end first. The functions borrow everything that they are made of, so that a thread owns all of it and answers requests.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, PoisonError};
use std::thread;

use lacuna::run::Silent;
use lacuna_engine::serve::{self, Function};
use lacuna_engine::study::Study;
use lacuna_engine::study::resolve::{self, Use};
use lacuna_linalg::Matrix;
use lacuna_run::RunDirectory;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::problems::{RunError, StudyError, stopped};

/// A question to the thread.
enum Asked {
    /// Values at points.
    Values(Matrix),
    /// Standard deviations of the error at points.
    Deviations(Matrix),
    /// New replicates at points, with random numbers of a seed.
    Replicates(Matrix, u64),
    /// Derivative of each value by each variable at a point.
    Jacobian(Vec<f64>),
}

/// An answer: a table, or nothing where it is not known.
type Answer = Result<Option<Matrix>, String>;

struct Request {
    function: usize,
    asked: Asked,
    answer: Sender<Answer>,
}

/// What a function is called and which variables it has.
#[derive(Clone)]
struct About {
    name: String,
    variables: Vec<(String, String)>,
    outputs: usize,
    has_derivatives: bool,
}

/// Model, emulator and posterior of a finished run.
#[pyclass(frozen, module = "lacuna._engine")]
pub struct Functions {
    requests: Mutex<Sender<Request>>,
    all: Vec<About>,
    /// Layouts of the response as JSON: for each scenario its name, its axes and its unit.
    #[pyo3(get)]
    layouts: String,
}

#[pymethods]
impl Functions {
    /// The functions of the run in a folder.
    ///
    /// # Errors
    /// `StudyError` if the folder has no run, `RunError` if the run is not finished.
    #[new]
    fn new(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        let (requests, inbox) = channel();
        let (ready, begun) = channel();
        thread::spawn(move || served(&folder, &inbox, &ready));
        let begun = py.detach(move || begun.recv());
        let (all, layouts) = begun.map_err(|_| RunError::new_err("the run cannot be read"))??;
        Ok(Self { requests: Mutex::new(requests), all, layouts })
    }

    /// Names of the functions.
    fn names(&self) -> Vec<String> {
        self.all.iter().map(|about| about.name.clone()).collect()
    }

    /// Names and units of the variables of a function.
    fn variables(&self, name: &str) -> PyResult<Vec<(String, String)>> {
        Ok(self.all[self.place(name)?].variables.clone())
    }

    /// Number of values of a function.
    fn outputs(&self, name: &str) -> PyResult<usize> {
        Ok(self.all[self.place(name)?].outputs)
    }

    /// True if a function has exact derivatives.
    fn has_derivatives(&self, name: &str) -> PyResult<bool> {
        Ok(self.all[self.place(name)?].has_derivatives)
    }

    /// Values at points, one per row.
    fn values<'py>(
        &self,
        py: Python<'py>,
        name: &str,
        points: &[u8],
    ) -> PyResult<Option<Bound<'py, PyBytes>>> {
        self.table(py, name, Asked::Values(self.points(name, points)?))
    }

    /// Standard deviations of the error at points, one per row; `None` if they are not known.
    fn deviations<'py>(
        &self,
        py: Python<'py>,
        name: &str,
        points: &[u8],
    ) -> PyResult<Option<Bound<'py, PyBytes>>> {
        self.table(py, name, Asked::Deviations(self.points(name, points)?))
    }

    /// A new replicate at each point, one per row, with random numbers of a seed; `None` if the function has none.
    fn replicates<'py>(
        &self,
        py: Python<'py>,
        name: &str,
        points: &[u8],
        seed: u64,
    ) -> PyResult<Option<Bound<'py, PyBytes>>> {
        self.table(py, name, Asked::Replicates(self.points(name, points)?, seed))
    }

    /// Derivative of each value by each variable at a point, as bytes; `None` if they are not known exactly.
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        name: &str,
        point: &[u8],
    ) -> PyResult<Option<Bound<'py, PyBytes>>> {
        let point = self.points(name, point)?.into_vec();
        self.table(py, name, Asked::Jacobian(point))
    }
}

impl Functions {
    fn place(&self, name: &str) -> PyResult<usize> {
        let place = self.all.iter().position(|about| about.name == name);
        place.ok_or_else(|| {
            let names: Vec<&str> = self.all.iter().map(|about| about.name.as_str()).collect();
            PyValueError::new_err(format!("the run has no `{name}`; it has {}", names.join(", ")))
        })
    }

    /// Points of a function, one per row.
    fn points(&self, name: &str, bytes: &[u8]) -> PyResult<Matrix> {
        let columns = self.all[self.place(name)?].variables.len();
        let (numbers, rest) = bytes.as_chunks::<8>();
        if columns == 0 || !rest.is_empty() || numbers.len() % columns != 0 {
            let text = format!("`{name}` has {columns} variables, which these points do not have");
            return Err(PyValueError::new_err(text));
        }
        let numbers: Vec<f64> = numbers.iter().map(|number| f64::from_le_bytes(*number)).collect();
        Ok(Matrix::from_vec(numbers.len() / columns, columns, numbers))
    }

    fn table<'py>(
        &self,
        py: Python<'py>,
        name: &str,
        asked: Asked,
    ) -> PyResult<Option<Bound<'py, PyBytes>>> {
        let function = self.place(name)?;
        let (answer, inbox) = channel();
        let request = Request { function, asked, answer };
        let sent = self.requests.lock().unwrap_or_else(PoisonError::into_inner).send(request);
        let lost = || RunError::new_err("the functions of the run have ended");
        sent.map_err(|_| lost())?;
        let answer =
            py.detach(move || inbox.recv()).map_err(|_| lost())?.map_err(RunError::new_err)?;
        Ok(answer.map(|table| bytes(py, &table)))
    }
}

fn bytes<'py>(py: Python<'py>, table: &Matrix) -> Bound<'py, PyBytes> {
    let all: Vec<u8> = table.as_slice().iter().flat_map(|x| x.to_le_bytes()).collect();
    PyBytes::new(py, &all)
}

type Begun = PyResult<(Vec<About>, String)>;

/// Answers requests until nobody is left to ask.
fn served(folder: &std::path::Path, inbox: &Receiver<Request>, ready: &Sender<Begun>) {
    let failed = |error: PyErr| {
        let _ = ready.send(Err(error));
    };
    let (study, run) = match opened(folder) {
        Ok(opened) => opened,
        Err(error) => return failed(error),
    };
    let layouts = serde_json::to_string(&study.layouts).unwrap_or_default();
    let answered = serve::functions(&study, Some(run), &Silent, |all| {
        let _ = ready.send(Ok((all.iter().map(|function| about(*function)).collect(), layouts)));
        for request in inbox {
            let _ = request.answer.send(answer(all[request.function], &request.asked));
        }
    });
    if let Err(stop) = answered {
        failed(stopped(&stop));
    }
}

fn opened(folder: &std::path::Path) -> PyResult<(Study, RunDirectory)> {
    let resolved = folder.join("resolved.toml");
    if !resolved.exists() {
        let text = format!("{} is no run directory: it has no resolved.toml", folder.display());
        return Err(StudyError::new_err(text));
    }
    let checked = resolve::load_for(&resolved, &[], Use::Look);
    let complaints = checked.complaints();
    let study = checked.study.ok_or_else(|| StudyError::new_err(complaints))?;
    let mut run = RunDirectory::open(folder).map_err(|stop| stopped(&stop))?;
    run.look();
    Ok((study, run))
}

fn about(function: &dyn Function) -> About {
    let variables = function.variables().into_iter();
    About {
        name: function.name().to_owned(),
        variables: variables.map(|v| (v.name, v.unit.to_string())).collect(),
        outputs: function.outputs(),
        has_derivatives: function.derivatives().is_some(),
    }
}

fn answer(function: &dyn Function, asked: &Asked) -> Answer {
    let told = |error: lacuna::plugin::model::EvalError| error.to_string();
    match asked {
        Asked::Values(points) => function.batch(points).map(Some).map_err(told),
        Asked::Deviations(points) => Ok(function.deviations(points)),
        Asked::Replicates(points, seed) => function.replicates(points, *seed).map_err(told),
        Asked::Jacobian(point) => match function.derivatives() {
            Some(derivatives) => derivatives.jacobian(point, None).map(Some).map_err(told),
            None => Ok(None),
        },
    }
}
