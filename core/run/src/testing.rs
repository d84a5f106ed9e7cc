//! A minimal stage for tests, which makes a number.

use std::path::Path;

use lacuna::run::{Silent, Stop, files};

use crate::{Artifact, RunDirectory, Stage};

/// An artifact that is one number.
#[derive(Debug, PartialEq)]
pub struct Number(pub f64);

impl Artifact for Number {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_json(&folder.join("number.json"), &self.0)?;
        Ok(vec!["number.json".to_owned()])
    }
    fn load(folder: &Path) -> Result<Self, Stop> {
        Ok(Self(files::read_json(&folder.join("number.json"))?))
    }
}

/// The number that is kept for an input, made as `value` if there is none; returns true if it was made.
pub fn keep(run: &mut RunDirectory, input: u32, value: f64) -> (f64, bool) {
    let kept = run.keep(&Stage::Read.folder(), &input, &Silent, |_| Ok(Number(value)));
    let kept = kept.unwrap_or_else(|stop| panic!("{stop}"));
    (kept.value.0, kept.fresh)
}
