//! What all kinds of plugins share.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::Fault;
use super::abi::Library;
use crate::data::{Layout, Parameter, Scenario, Unit};
use crate::study::problem::Complaints;

/// The rest of the study, as a plugin sees it while it checks itself.
#[derive(Debug, Clone, Copy)]
pub struct Context<'a> {
    /// The folder of the study file; relative paths start here.
    pub directory: &'a Path,
    /// The unknowns of the model.
    pub parameters: &'a [Parameter],
    /// What the study sets of its model's inputs, in the order in which it is written: parameters, values that
    /// are fixed, and the values of scenarios.
    pub given: &'a [Given],
    /// The known conditions; one without a name where the study has no scenarios.
    pub scenarios: &'a [Scenario],
    /// The shape of the response; for a model that to one scenario.
    pub layout: &'a Layout,
    /// The number of runs that the design makes, where the study has a design.
    pub runs: Option<usize>,
    /// Whether the likelihood will have errors that all replicates share: of the emulator or of the
    /// model's numerics. Those of the replicates' mean are known only with the data.
    pub common_errors: bool,
    /// Whether a plugin may start programs that the study names to look at them; `lacuna check` starts none.
    pub starts_programs: bool,
}

impl<'a> Context<'a> {
    /// A study of these parameters and this response, and nothing else.
    pub fn new(directory: &'a Path, parameters: &'a [Parameter], layout: &'a Layout) -> Self {
        Self {
            directory,
            parameters,
            given: &[],
            scenarios: &[],
            layout,
            runs: None,
            common_errors: false,
            starts_programs: true,
        }
    }
}

/// What a study sets of an input of its model.
#[derive(Debug, Clone, PartialEq)]
pub struct Given {
    /// The name of the input.
    pub name: String,
    /// The unit in which the study gives it; `None` for a plain number in the model's unit.
    pub unit: Option<Unit>,
}

/// What every plugin does besides its own work.
pub trait Component: Send + Sync {
    /// Second layer of checking: the options against the rest of the study. No files are touched.
    fn check(&self, _context: &Context<'_>, _complaints: &mut Complaints<'_>) {}

    /// Third layer of checking: the options against the machine (files, commands). Nothing is changed, and no program of the
    /// study's is started unless the context allows it.
    fn environment(&self, _context: &Context<'_>, _complaints: &mut Complaints<'_>) {}

    /// Where it says that it can answer no more, for a plugin to which that may happen outside of any error; of one
    /// that asks others, where those say so.
    fn faults(&self) -> Vec<Arc<Fault>> {
        Vec::new()
    }

    /// The libraries of the plugins that it asks, where its options choose some; its own is not its business.
    fn libraries(&self) -> Vec<&'static Library> {
        Vec::new()
    }

    /// The revisions of the plugins that it asks, where its options choose some, by kind and name; its own is not its
    /// business.
    fn revisions(&self) -> BTreeMap<String, u32> {
        BTreeMap::new()
    }
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
