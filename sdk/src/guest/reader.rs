//! Readers of a library.

use std::path::Path;

use lacuna::matrix::Matrix;
use lacuna::plugin::Reader;
use lacuna_abi::Refusal;
use lacuna_abi::argument::{Buffer, Space};
use lacuna_abi::guard::{Done, Out};
use lacuna_abi::table::ServeReader;
use lacuna_abi::wire::{ContentsAbout, EnsembleAbout, MeasuredAbout, OwnedSource};

use super::{Authored, Plugin, text};

fn read(source: &[u8]) -> Result<OwnedSource, Refusal> {
    Ok(serde_json::from_slice(source)?)
}

fn incomplete() -> Refusal {
    Refusal::stop("the source is not complete")
}

impl<T: Reader + Authored> ServeReader for Plugin<T> {
    fn recognises(&self, path: &[u8], head: &[u8]) -> i32 {
        i32::from(self.0.recognises(Path::new(&*text(path)), head))
    }

    fn inspect(&self, path: &[u8], out: &Out) -> Done {
        let contents = self.0.inspect(Path::new(&*text(path)))?;
        let (about, matrices) = ContentsAbout::take_apart(contents);
        for matrix in &matrices {
            out.numbers(matrix);
        }
        out.json(&about)
    }

    fn names_files(&self) -> i32 {
        i32::from(self.0.names_files())
    }

    fn files(&self, source: &[u8], out: &Out) -> Done {
        let source = read(source)?;
        out.json(&self.0.files(&source.directory, source.scenario.as_deref()))
    }

    fn ensemble(&self, source: &[u8], out: &Out) -> Done {
        let source = read(source)?;
        let read = self.0.ensemble(&source.ensemble().ok_or_else(incomplete)?)?;
        out.numbers(&read.points);
        out.numbers(&read.responses);
        out.json(&EnsembleAbout { runs: read.runs, valid: read.valid, failed: read.failed })
    }

    fn measurements(&self, source: &[u8], out: &Out) -> Done {
        let source = read(source)?;
        let read = self.0.measurements(&source.measurements().ok_or_else(incomplete)?)?;
        let outputs = read.layout.len();
        let rows = read.replicates.iter().map(|replicate| {
            replicate.values.iter().map(|value| value.unwrap_or(f64::NAN)).collect::<Vec<f64>>()
        });
        out.numbers(&Matrix::from_rows(outputs, rows));
        let about = MeasuredAbout::of(&read);
        if matches!(about, MeasuredAbout::Stated { sd: true, .. }) {
            let none = || vec![f64::NAN; outputs];
            let sd = read.replicates.iter().map(|r| r.sd.clone().unwrap_or_else(none));
            out.numbers(&Matrix::from_rows(outputs, sd));
        }
        read.covariance.iter().for_each(|covariance| out.numbers(covariance));
        out.json(&about)
    }

    fn grid(&self, source: &[u8], out: &Out) -> Done {
        out.row(&self.0.grid(&read(source)?.grid().ok_or_else(incomplete)?)?);
        Ok(())
    }

    fn response(
        &self,
        path: &[u8],
        layout: &[u8],
        outputs: usize,
        to: Buffer<'_>,
        _: &Out,
    ) -> Done {
        let layout = serde_json::from_slice(layout)?;
        let response = self.0.response(Path::new(&*text(path)), &layout)?;
        // SAFETY: the buffer holds one number an output.
        unsafe { to.fill(outputs, &response) }
    }

    fn allowed_failures(&self, runs: usize, allowed: Space<'_, usize>, _: &Out) -> Done {
        let count = self.0.allowed_failures(runs).ok_or_else(Refusal::absent)?;
        // SAFETY: the caller gives a place for one number.
        unsafe { allowed.put(count) };
        Ok(())
    }
}
