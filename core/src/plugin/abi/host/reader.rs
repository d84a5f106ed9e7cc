//! Readers of libraries.

use std::path::{Path, PathBuf};

use super::Plugin;
use super::object::{finite_only, shaped};
use super::plugin::optional;
use crate::data::{Ensemble, Layout, Measurements, Replicate};
use crate::linalg::Matrix;
use crate::plugin::abi::table::{Answer, ReaderFunctions, Text};
use crate::plugin::abi::wire::{
    ContentsAbout, EnsembleAbout, FailureAbout, MeasuredAbout, OwnedSource,
};
use crate::plugin::abi::{Refusal, Reply};
use crate::plugin::reader::{
    Contents, EnsembleSource, GridSource, MeasurementSource, ReadError, Reader,
};

/// A function that answers something about a source or a file.
type Told = Option<unsafe extern "C" fn(*mut std::ffi::c_void, Text, *const Answer) -> i32>;

impl Plugin<ReaderFunctions> {
    fn told(&self, what: &'static str, ask: Told, text: &str) -> Result<Reply, Refusal> {
        let this = self.object.this;
        // SAFETY: the function belongs to the plugin, and the text is there until it returns.
        let call = |a| optional(ask, |f| unsafe { f(this, Text::of(text), a) });
        let none = || Refusal::stop(format!("this reader does not read {what}"));
        self.object.ask(what, call)?.ok_or_else(none)
    }

    fn of_source(
        &self,
        what: &'static str,
        ask: Told,
        source: &OwnedSource,
    ) -> Result<Reply, Refusal> {
        self.told(what, ask, &serde_json::to_string(source)?)
    }

    fn or_unread<T>(&self, read: Result<T, Refusal>, path: &Path) -> Result<T, ReadError> {
        read.map_err(|refusal| {
            FailureAbout::read(&refusal.message, path, self.object.fault().who())
        })
    }

    fn runs(&self, source: &EnsembleSource<'_>) -> Result<Ensemble, Refusal> {
        let reply =
            self.of_source("simulation runs", self.object.functions.ensemble, &source.into())?;
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
        let Some(ask) = self.object.functions.allowed_failures else { return Ok(None) };
        let (this, mut allowed) = (self.object.this, usize::MAX);
        let to = &raw mut allowed;
        // SAFETY: the function belongs to the plugin, and the place for the number is there until it returns.
        let call = |a| unsafe { ask(this, runs, to, a) };
        match self.object.ask("allowed_failures", call)? {
            None => Ok(None),
            Some(_) if allowed == usize::MAX => {
                Err(Refusal::stop("`allowed_failures` gives no number of runs"))
            }
            Some(_) => Ok(Some(allowed)),
        }
    }

    fn measured(&self, source: &MeasurementSource<'_>) -> Result<Measurements, Refusal> {
        let reply =
            self.of_source("measurements", self.object.functions.measurements, &source.into())?;
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
        let (ask, this) = (self.object.functions.response, self.object.this);
        let (file, layout_text) = (path.to_string_lossy(), serde_json::to_string(layout)?);
        let (file, shape) = (Text::of(&file), Text::of(&layout_text));
        let values = self.object.ask_numbers("response", layout.len(), |to, a| {
            // SAFETY: the function belongs to the plugin; the buffer holds one number an output.
            optional(ask, |f| unsafe { f(this, file, shape, layout.len(), to, a) })
        })?;
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
        let path = path.to_string_lossy();
        let ask = self.object.functions.recognises;
        // SAFETY: the function belongs to the plugin; the texts are there until it returns.
        ask.is_some_and(|f| unsafe {
            f(self.object.this, Text::of(&path), Text::of_bytes(head)) == 1
        })
    }

    fn inspect(&self, path: &Path) -> Result<Contents, ReadError> {
        let read = || {
            let reply = self.told(
                "what is in a file",
                self.object.functions.inspect,
                &path.to_string_lossy(),
            )?;
            let about: ContentsAbout = reply.json()?;
            let wrong =
                || Refusal::stop("`inspect` answers matrices that are not those of the variables");
            about.put_together(&reply.matrices).ok_or_else(wrong)
        };
        self.or_unread(read(), path)
    }

    fn names_files(&self) -> bool {
        // SAFETY: the function belongs to the plugin.
        self.object.functions.names_files.is_some_and(|f| unsafe { f(self.object.this) == 1 })
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
        let read = || {
            let reply = self.of_source(
                "where the measurements were taken",
                self.object.functions.grid,
                &source.into(),
            )?;
            let row = reply.row()?;
            finite_only("grid", &row)?;
            Ok(row)
        };
        self.or_unread(read(), source.directory)
    }

    fn response(&self, path: &Path, layout: &Layout) -> Result<Vec<f64>, ReadError> {
        self.or_unread(self.one(path, layout), path)
    }

    fn files(&self, directory: &Path, scenario: Option<&str>) -> Vec<PathBuf> {
        let source = OwnedSource::of(directory, scenario);
        let said = self.of_source("files", self.object.functions.files, &source);
        self.object.or_fault(said.and_then(|reply| reply.json()), Vec::new)
    }
}
