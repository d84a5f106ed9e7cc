//! What all kinds of plugins share.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::data::{Layout, Parameter};
use crate::study::problem::Complaints;

/// The rest of the study, as a plugin sees it while it checks itself.
#[derive(Debug, Clone, Copy)]
pub struct Context<'a> {
    /// The folder of the study file; relative paths start here.
    pub directory: &'a Path,
    /// The unknowns of the model.
    pub parameters: &'a [Parameter],
    /// The shape of the response.
    pub layout: &'a Layout,
    /// The number of runs that the design makes, where the study has a design.
    pub runs: Option<usize>,
    /// Whether the likelihood will have errors that all replicates share: of the emulator or of the
    /// model's numerics. Those of the replicates' mean are known only with the data.
    pub common_errors: bool,
}

/// What every plugin does besides its own work.
pub trait Component: Send + Sync {
    /// Second layer of checking: the options against the rest of the study. No files are touched.
    fn check(&self, _context: &Context<'_>, _complaints: &mut Complaints<'_>) {}

    /// Third layer of checking: the options against the machine (files, commands). Nothing is changed.
    fn environment(&self, _context: &Context<'_>, _complaints: &mut Complaints<'_>) {}
}

/// One fact about a result, for people: a row of a table in the report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fact {
    /// What it is, such as `largest degree`.
    pub name: String,
    /// Its value in words or figures, unit included.
    pub value: String,
}

impl Fact {
    /// A fact from its name and value.
    pub fn new(name: impl Into<String>, value: impl ToString) -> Self {
        Self { name: name.into(), value: value.to_string() }
    }
}
