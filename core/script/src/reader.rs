//! Readers in Python.

use std::path::{Path, PathBuf};

use lacuna::data::{Ensemble, Measurements, Replicate};
use lacuna::plugin::reader::{
    Contents, EnsembleSource, GridSource, MeasurementSource, ReadError, Reader,
};
use lacuna_abi::Refusal;
use lacuna_abi::check::{finite_only, shaped};
use serde_json::json;

use crate::object::{Call, Plugin, answer, matrices};

impl Plugin {
    fn or_unread<T>(
        &self,
        method: &str,
        what: &str,
        read: impl FnOnce() -> Result<T, Refusal>,
        path: &Path,
    ) -> Result<T, ReadError> {
        if !self.0.has(method) {
            return Err(ReadError::new(path, format!("this reader does not read {what}")));
        }
        read().map_err(|refusal| ReadError::new(path, self.0.said(&refusal)))
    }

    fn measured(&self, source: &MeasurementSource<'_>) -> Result<Measurements, Refusal> {
        let about = json!({
            "directory": source.directory, "layout": source.layout, "scenario": source.scenario,
        });
        let message = self.0.ask(&Call::new("measurements", &[]).about(about))?;
        let names: Vec<String> = answer(&message)?;
        let [values] = matrices(message)?;
        shaped("measurements", &values, names.len(), source.layout.len())?;
        if let Some(x) = values.as_slice().iter().find(|x| x.is_infinite()) {
            return Err(Refusal::stop(format!("`measurements` gives the value {x}")));
        }
        let replicate = |(name, row): (String, &[f64])| {
            Replicate::new(name, row.iter().map(|y| (!y.is_nan()).then_some(*y)).collect())
        };
        let replicates = names.into_iter().zip(values.iter_rows()).map(replicate).collect();
        Ok(Measurements::new(source.layout.clone(), replicates))
    }

    fn read_runs(&self, source: &EnsembleSource<'_>) -> Result<Ensemble, Refusal> {
        let names: Vec<String> = source.parameters.iter().map(|p| p.name.clone()).collect();
        let about = json!({
            "directory": source.directory, "layout": source.layout, "scenario": source.scenario,
            "parameters": names,
        });
        let [points, responses] = matrices(self.0.ask(&Call::new("runs", &[]).about(about))?)?;
        let count = points.rows();
        shaped("runs", &points, count, names.len())?;
        shaped("runs", &responses, count, source.layout.len())?;
        finite_only("runs", points.as_slice())?;
        finite_only("runs", responses.as_slice())?;
        Ok(Ensemble {
            parameters: names,
            units: source.parameters.iter().map(|p| p.unit.clone()).collect(),
            runs: (1..=count).map(|run| run.to_string()).collect(),
            points,
            layouts: source.layout.clone().into(),
            responses,
            valid: vec![true; count],
            failed: Vec::new(),
        })
    }

    fn numbers(&self, source: &GridSource<'_>) -> Result<Vec<f64>, Refusal> {
        let about = json!({
            "directory": source.directory, "scenario": source.scenario,
            "axis": source.axis, "unit": source.unit,
        });
        let [values] = matrices(self.0.ask(&Call::new("grid", &[]).about(about))?)?;
        let values = values.into_vec();
        finite_only("grid", &values)?;
        match values.windows(2).find(|pair| pair[0] >= pair[1]) {
            Some(pair) => {
                let (a, b) = (pair[0], pair[1]);
                Err(Refusal::stop(format!(
                    "`grid` gives {b} after {a}, expected increasing numbers"
                )))
            }
            None => Ok(values),
        }
    }
}

impl Reader for Plugin {
    fn recognises(&self, _: &Path, _: &[u8]) -> bool {
        false
    }

    fn inspect(&self, path: &Path) -> Result<Contents, ReadError> {
        Err(ReadError::new(path, "a reader in Python does not list the contents of a file"))
    }

    fn names_files(&self) -> bool {
        true
    }

    fn ensemble(&self, source: &EnsembleSource<'_>) -> Result<Ensemble, ReadError> {
        self.or_unread("runs", "simulation runs", || self.read_runs(source), source.directory)
    }

    fn measurements(&self, source: &MeasurementSource<'_>) -> Result<Measurements, ReadError> {
        self.or_unread("measurements", "measurements", || self.measured(source), source.directory)
    }

    fn grid(&self, source: &GridSource<'_>) -> Result<Vec<f64>, ReadError> {
        let what = "where the measurements were taken";
        self.or_unread("grid", what, || self.numbers(source), source.directory)
    }

    fn files(&self, directory: &Path, scenario: Option<&str>) -> Vec<PathBuf> {
        let asked = || {
            let about = json!({ "scenario": scenario });
            let paths: Vec<PathBuf> = answer(&self.0.ask(&Call::new("files", &[]).about(about))?)?;
            Ok(paths.iter().map(|path| directory.join(path)).collect())
        };
        self.0.or_fault(asked(), Vec::new)
    }
}
