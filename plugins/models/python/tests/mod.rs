//! `LACUNA_PYTHON` names the interpreter; otherwise `python3` is used if it exists. Without either the tests report
//! that they are skipped, unless `LACUNA_REQUIRE_PYTHON=1` makes that a failure.
#![allow(clippy::unwrap_used)]

mod calls;
mod checks;
mod failures;

use std::path::{Path, PathBuf};

use lacuna::data::{Axis, Condition, Layout, Scenario, Unit};
use lacuna::plugin::Model;
use lacuna::plugin::model::{Call, EvalError, Response};
use lacuna::plugin::registry::from_text;
use lacuna_linalg::Matrix;

use lacuna_run::process;

/// The interpreter; `None` if there is none and none is required.
fn interpreter() -> Option<PathBuf> {
    let named = std::env::var_os("LACUNA_PYTHON").map(PathBuf::from);
    let found = named.or_else(|| process::find("python3", Path::new("."), None));
    let required = std::env::var_os("LACUNA_REQUIRE_PYTHON").is_some_and(|value| value == "1");
    assert!(
        found.is_some() || !required,
        "LACUNA_REQUIRE_PYTHON is set, and there is no `python3`"
    );
    if found.is_none() {
        println!("skipped: there is no `python3`");
    }
    found
}

/// A model with the inputs `a` = 2 and `b` = 0.5 and a response of two sensors at three times.
struct Case {
    model: Box<dyn Model>,
    study: tempfile::TempDir,
    layout: Layout,
    names: Vec<String>,
    scenario: Scenario,
}

impl Case {
    /// A model of this Python text; `None` without Python.
    fn new(text: &str, options: &str) -> Option<Self> {
        let python = interpreter()?;
        let options = format!("file = 'model.py'\ninterpreter = '{}'\n{options}", python.display());
        let built = from_text::<dyn Model>("python", &options).unwrap_or_else(|e| panic!("{e}"));
        let study = tempfile::tempdir().unwrap();
        std::fs::write(study.path().join("model.py"), text).unwrap();
        let times = vec![1.0, 2.0, 3.0];
        let axes = vec![
            Axis::labels("sensor", ["B", "C"]),
            Axis::grid("time", times, Unit::parse("s").unwrap()),
        ];
        let power = Condition { name: "power".to_owned(), value: 1.4, unit: None };
        Some(Self {
            model: built.plugin,
            study,
            layout: Layout { name: "strain".to_owned(), unit: Unit::dimensionless(), axes },
            names: ["a", "b"].map(str::to_owned).to_vec(),
            scenario: Scenario {
                name: "full".to_owned(),
                values: vec![power],
                ..Scenario::default()
            },
        })
    }

    fn call<'a>(&'a self, inputs: &'a [f64]) -> Call<'a> {
        let plain = Call::new(inputs, &self.names, &self.layout, &self.scenario);
        Call { study: self.study.path(), ..plain }
    }

    fn at(&self, inputs: [f64; 2]) -> Result<Vec<f64>, EvalError> {
        values(self.model.predict(&self.call(&inputs)))
    }

    fn run(&self) -> Result<Vec<f64>, EvalError> {
        self.at([2.0, 0.5])
    }

    fn batch(&self, inputs: &[[f64; 2]]) -> Vec<Result<Vec<f64>, EvalError>> {
        let calls: Vec<Call<'_>> = inputs.iter().map(|inputs| self.call(inputs)).collect();
        self.model.predict_batch(&calls).into_iter().map(values).collect()
    }

    fn jacobian(&self) -> Result<Matrix, EvalError> {
        self.model.gradient().unwrap().jacobian(&self.call(&[2.0, 0.5]))
    }

    fn reason(&self) -> String {
        match self.run() {
            Err(EvalError::Rejected(reason)) => reason,
            other => panic!("{other:?}"),
        }
    }

    fn stop(&self) -> String {
        match self.run() {
            Err(EvalError::Fatal(reason)) => reason,
            other => panic!("{other:?}"),
        }
    }
}

fn values(response: Result<Response, EvalError>) -> Result<Vec<f64>, EvalError> {
    response.map(|response| response.values)
}

/// `a t + b` at the first sensor, its negative at the second.
const LINES: &str = "
def simulate(a, b):
    up = [a * t + b for t in (1, 2, 3)]
    return [up, [-y for y in up]]
";
