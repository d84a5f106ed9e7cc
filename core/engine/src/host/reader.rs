//! Readers of libraries.

use std::path::{Path, PathBuf};

use lacuna::data::{Ensemble, Layout, Measurements, Replicate};
use lacuna::plugin::reader::{
    Contents, EnsembleSource, GridSource, MeasurementSource, ReadError, Reader,
};
use lacuna_abi::check::{finite_only, shaped};
use lacuna_abi::object::{Asked, numbers_if_any};
use lacuna_abi::table::ReaderFunctions;
use lacuna_abi::wire::{ContentsAbout, EnsembleAbout, FailureAbout, MeasuredAbout, OwnedSource};
use lacuna_abi::{Refusal, Reply};
use lacuna_linalg::Matrix;

use super::Plugin;

/// An answer of what a reader reads.
fn read(asked: Asked, what: &str) -> Result<Reply, Refusal> {
    asked.if_any()?.ok_or_else(|| Refusal::stop(format!("this reader does not read {what}")))
}

fn written(source: &OwnedSource) -> Result<String, Refusal> {
    Ok(serde_json::to_string(source)?)
}

impl Plugin<ReaderFunctions> {
    fn or_unread<T>(&self, read: Result<T, Refusal>, path: &Path) -> Result<T, ReadError> {
        read.map_err(|refusal| {
            FailureAbout::read(&refusal.message, path, self.object.fault().who())
        })
    }

    fn runs(&self, source: &EnsembleSource<'_>) -> Result<Ensemble, Refusal> {
        let text = written(&source.into())?;
        // SAFETY: nothing is written.
        let reply = read(unsafe { self.object.ensemble(&text) }, "simulation runs")?;
        let about: EnsembleAbout = reply.json()?;
        let [points, responses] = reply.matrices()?;
        let count = about.runs.len();
        shaped("ensemble", &points, count, source.parameters.len())?;
        shaped("ensemble", &responses, count, source.layout.len())?;
        if let Some(x) =
            points.as_slice().iter().chain(responses.as_slice()).find(|x| !x.is_finite())
        {
            return Err(Refusal::stop(format!("`ensemble` answers a run with the value {x}")));
        }
        let valid = if about.valid.is_empty() { vec![true; count] } else { about.valid };
        if valid.len() != count {
            return Err(Refusal::stop(
                "`ensemble` says of another number of runs whether they are valid",
            ));
        }
        Ok(Ensemble {
            parameters: source.parameters.iter().map(|p| p.name.clone()).collect(),
            units: source.parameters.iter().map(|p| p.unit.clone()).collect(),
            runs: about.runs,
            points,
            layouts: source.layout.clone().into(),
            responses,
            valid,
            failed: about.failed,
        })
    }

    fn allowed(&self, runs: usize) -> Result<Option<usize>, Refusal> {
        let mut allowed = usize::MAX;
        // SAFETY: there is a place for one number.
        let asked = unsafe { self.object.allowed_failures(runs, &raw mut allowed) };
        match asked.if_any()? {
            None => Ok(None),
            Some(_) if allowed == usize::MAX => {
                Err(Refusal::stop("`allowed_failures` gives no number of runs"))
            }
            Some(_) => Ok(Some(allowed)),
        }
    }

    fn measured(&self, source: &MeasurementSource<'_>) -> Result<Measurements, Refusal> {
        let text = written(&source.into())?;
        // SAFETY: nothing is written.
        let reply = read(unsafe { self.object.measurements(&text) }, "measurements")?;
        let (names, states_sd, states_covariance) = reply.json::<MeasuredAbout>()?.parts();
        let (count, outputs) = (names.len(), source.layout.len());
        let (values, sd, covariance) = match (states_sd, states_covariance) {
            (false, false) => {
                let [values] = reply.matrices()?;
                (values, None, None)
            }
            (true, false) => {
                let [values, sd] = reply.matrices()?;
                (values, Some(sd), None)
            }
            (false, true) => {
                let [values, covariance] = reply.matrices()?;
                (values, None, Some(covariance))
            }
            (true, true) => {
                let [values, sd, covariance] = reply.matrices()?;
                (values, Some(sd), Some(covariance))
            }
        };
        shaped("measurements", &values, count, outputs)?;
        sd.iter().try_for_each(|sd| deviations(sd, count, outputs))?;
        covariance.iter().try_for_each(|covariance| variances(covariance, outputs))?;
        if let Some(x) = values.as_slice().iter().find(|x| x.is_infinite()) {
            return Err(Refusal::stop(format!("`measurements` answers the value {x}")));
        }
        let replicate = |(r, (name, row)): (usize, (String, &[f64]))| {
            let values = row.iter().map(|y| (!y.is_nan()).then_some(*y)).collect();
            let sd = sd.as_ref().map(|sd| sd.row(r)).filter(|sd| !states_nothing(sd));
            Replicate { name, values, sd: sd.map(<[f64]>::to_vec) }
        };
        let rows = names.into_iter().zip(values.iter_rows()).enumerate();
        let (layout, replicates) = (source.layout.clone(), rows.map(replicate).collect());
        Ok(Measurements { layout, replicates, covariance })
    }

    fn one(&self, path: &Path, layout: &Layout) -> Result<Vec<f64>, Refusal> {
        let (count, file, shape) =
            (layout.len(), path.to_string_lossy(), serde_json::to_string(layout)?);
        // SAFETY: the buffer holds one number an output.
        let call = |to| unsafe { self.object.response(&*file, &shape, count, to) };
        let values = numbers_if_any(count, call)?;
        let none = || Refusal::stop("this reader does not read a single response");
        let values = values.ok_or_else(none)?;
        finite_only("response", &values)?;
        Ok(values)
    }
}

/// True for a replicate without stated standard deviations.
fn states_nothing(sd: &[f64]) -> bool {
    sd.iter().all(|sd| sd.is_nan())
}

/// Complains of what are no standard deviations: of each replicate that states any they are finite and not negative.
fn deviations(sd: &Matrix, replicates: usize, outputs: usize) -> Result<(), Refusal> {
    shaped("measurements", sd, replicates, outputs)?;
    let mut stated = sd.iter_rows().filter(|row| !states_nothing(row)).flatten();
    match stated.find(|sd| !(sd.is_finite() && **sd >= 0.0)) {
        None => Ok(()),
        Some(x) => Err(Refusal::stop(format!("`measurements` answers the standard deviation {x}"))),
    }
}

/// Complains of what is no covariance: it is finite, symmetric up to round-off, and no variance is negative.
fn variances(covariance: &Matrix, outputs: usize) -> Result<(), Refusal> {
    shaped("measurements", covariance, outputs, outputs)?;
    finite_only("measurements", covariance.as_slice())?;
    for i in 0..outputs {
        if covariance[(i, i)] < 0.0 {
            let x = covariance[(i, i)];
            return Err(Refusal::stop(format!("`measurements` answers the variance {x}")));
        }
        for j in 0..i {
            let (a, b) = (covariance[(i, j)], covariance[(j, i)]);
            let size = (covariance[(i, i)] * covariance[(j, j)]).sqrt();
            if (a - b).abs() > 1e-6 * size {
                let place = format!("of outputs {} and {}", j + 1, i + 1);
                let message = format!("answers {b} and {a} as the covariance {place}");
                return Err(Refusal::stop(format!("`measurements` {message}")));
            }
        }
    }
    Ok(())
}

impl Reader for Plugin<ReaderFunctions> {
    fn recognises(&self, path: &Path, head: &[u8]) -> bool {
        // SAFETY: nothing is written.
        unsafe { self.object.recognises(&*path.to_string_lossy(), head) == Some(1) }
    }

    fn inspect(&self, path: &Path) -> Result<Contents, ReadError> {
        let answered = || {
            // SAFETY: nothing is written.
            let asked = unsafe { self.object.inspect(&*path.to_string_lossy()) };
            let reply = read(asked, "what is in a file")?;
            let about: ContentsAbout = reply.json()?;
            let wrong =
                || Refusal::stop("`inspect` answers matrices that are not those of the variables");
            about.put_together(&reply.matrices).ok_or_else(wrong)
        };
        self.or_unread(answered(), path)
    }

    fn names_files(&self) -> bool {
        // SAFETY: nothing is written.
        unsafe { self.object.names_files() == Some(1) }
    }

    fn ensemble(&self, source: &EnsembleSource<'_>) -> Result<Ensemble, ReadError> {
        self.or_unread(self.runs(source), source.directory)
    }

    fn allowed_failures(&self, runs: usize) -> Option<usize> {
        self.object.or_fault(self.allowed(runs), || None)
    }

    fn measurements(&self, source: &MeasurementSource<'_>) -> Result<Measurements, ReadError> {
        self.or_unread(self.measured(source), source.directory)
    }

    fn grid(&self, source: &GridSource<'_>) -> Result<Vec<f64>, ReadError> {
        let answered = || {
            let text = written(&source.into())?;
            // SAFETY: nothing is written.
            let asked = unsafe { self.object.grid(&text) };
            let row = read(asked, "where the measurements were taken")?.row()?;
            finite_only("grid", &row)?;
            Ok(row)
        };
        self.or_unread(answered(), source.directory)
    }

    fn response(&self, path: &Path, layout: &Layout) -> Result<Vec<f64>, ReadError> {
        self.or_unread(self.one(path, layout), path)
    }

    fn files(&self, directory: &Path, scenario: Option<&str>) -> Vec<PathBuf> {
        let source = OwnedSource::of(directory, scenario);
        let said = || {
            // SAFETY: nothing is written.
            read(unsafe { self.object.files(&written(&source)?) }, "files")?.json()
        };
        self.object.or_fault(said(), Vec::new)
    }
}
