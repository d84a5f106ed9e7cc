#![allow(clippy::unwrap_used)]

mod failures;
mod runs;
mod texts;

use std::path::Path;

use lacuna::data::{Axis, Layout, Scenario, Unit};
use lacuna::plugin::Model;
use lacuna::plugin::model::{Call, EvalError};
use lacuna::plugin::registry::from_text;

/// A model with the inputs `a` = 2 and `b` = 0.5 and a response `y` over three times.
struct Case {
    model: Box<dyn Model>,
    study: tempfile::TempDir,
    layout: Layout,
}

const TIMES: [f64; 3] = [1.0, 2.0, 3.0];

impl Case {
    fn new(options: &str) -> Self {
        let built = from_text::<dyn Model>("external", options).unwrap_or_else(|e| panic!("{e}"));
        let axes = vec![Axis::grid("time", TIMES.to_vec(), Unit::parse("s").unwrap())];
        let layout = Layout { name: "y".to_owned(), unit: Unit::dimensionless(), axes };
        Self { model: built.plugin, study: tempfile::tempdir().unwrap(), layout }
    }

    /// A model that runs a shell script and reads `y.csv`.
    fn shell(script: &str, more: &str) -> Self {
        let output = "{ use = \"csv\", path = \"y.csv\" }";
        Self::new(&format!("command = [\"sh\", \"-c\", '''{script}''']\noutput = {output}\n{more}"))
    }

    fn file(&self, name: &str, text: &str) -> &Self {
        std::fs::write(self.study.path().join(name), text).unwrap();
        self
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.study.path().join(name)).unwrap_or_default()
    }

    fn ask(&self, inputs: &[f64], directory: Option<&Path>) -> Result<Vec<f64>, EvalError> {
        let names = ["a", "b"].map(str::to_owned);
        let scenario = Scenario::default();
        let call = Call {
            inputs,
            names: &names,
            units: &[],
            layout: &self.layout,
            scenario: &scenario,
            study: self.study.path(),
            directory,
        };
        self.model.predict(&call).map(|response| response.values)
    }

    /// Makes a run `run7` whose folder may stay.
    fn run(&self) -> Result<Vec<f64>, EvalError> {
        self.ask(&[2.0, 0.5], Some(&self.study.path().join("runs/run7")))
    }

    /// Returns the reason for which the run fails.
    fn reason(&self) -> String {
        match self.run() {
            Err(EvalError::Rejected(reason)) => reason,
            other => panic!("{other:?}"),
        }
    }
}

/// Shell lines that write `y.csv` with `a t + b`.
const LINE: &str = "\
printf 'time,y\\n' > y.csv
for t in 1 2 3; do
    printf '%s,%s\\n' $t $(echo \"{{ a }} * $t + {{ b }}\" | awk '{ print $1 * $3 + $5 }') >> y.csv
done";
