//! Readers of libraries.

use std::path::{Path, PathBuf};

use super::Plugin;
use super::object::{finite_only, shaped};
use super::plugin::optional;
use crate::data::{Ensemble, Layout, Measurements, Replicate};
use crate::plugin::abi::table::{Answer, ReaderFunctions, Text};
use crate::plugin::abi::wire::{ContentsAbout, EnsembleAbout, FailureAbout, OwnedSource};
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

    fn measured(&self, source: &MeasurementSource<'_>) -> Result<Measurements, Refusal> {
        let reply =
            self.of_source("measurements", self.object.functions.measurements, &source.into())?;
        let names: Vec<String> = reply.json()?;
        let [values] = reply.matrices()?;
        shaped("measurements", &values, names.len(), source.layout.len())?;
        if let Some(x) = values.as_slice().iter().find(|x| x.is_infinite()) {
            return Err(Refusal::stop(format!("`measurements` answers the value {x}")));
        }
        let replicate = |(name, row): (String, &[f64])| {
            Replicate::new(name, row.iter().map(|y| (!y.is_nan()).then_some(*y)).collect())
        };
        let replicates = names.into_iter().zip(values.iter_rows()).map(replicate).collect();
        Ok(Measurements::new(source.layout.clone(), replicates))
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
