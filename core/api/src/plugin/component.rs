//! Interface that plugins of all kinds share.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use lacuna_base::data::{Layout, Parameter, Scenario, Unit};
use lacuna_base::run::Fault;
use lacuna_base::text::problem::Complaints;
use serde::{Deserialize, Serialize};

use super::Library;

/// The rest of the study, as available to a plugin while it checks its options.
#[derive(Debug, Clone, Copy)]
pub struct Context<'a> {
    /// Folder of the study file; relative paths start here.
    pub directory: &'a Path,
    /// Unknown parameters of the model.
    pub parameters: &'a [Parameter],
    /// Inputs of the model that the study sets, in the order in which it is written: parameters, fixed values, and the
    /// values of scenarios.
    pub given: &'a [Given],
    /// Known conditions; a single scenario without a name if the study has none.
    pub scenarios: &'a [Scenario],
    /// Layout of the response; for a model, of the response to one scenario.
    pub layout: &'a Layout,
    /// Number of runs that the design makes; `None` without a design.
    pub runs: Option<usize>,
    /// True if the likelihood will have errors common to all replicates: of the emulator or of the model's numerics.
    /// Errors of the replicates' mean are known only with the data.
    pub common_errors: bool,
    /// True if a plugin may start programs and contact servers that the study names in order to inspect them; `lacuna check`
    /// does neither.
    pub starts_programs: bool,
}

impl<'a> Context<'a> {
    /// A context with these parameters and this response, and nothing else.
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

/// An input of the model that a study sets.
#[derive(Debug, Clone, PartialEq)]
pub struct Given {
    /// Name of the input.
    pub name: String,
    /// Unit in which the study gives it; `None` for a plain number in the model's unit.
    pub unit: Option<Unit>,
}

/// Interface of every plugin besides that of its kind.
pub trait Component: Send + Sync {
    /// Second layer of checks: the options against the rest of the study. No files are accessed.
    fn check(&self, _context: &Context<'_>, _complaints: &mut Complaints<'_>) {}

    /// Third layer of checks: the options against the machine (files, commands). Nothing is changed, and no program
    /// named by the study is started unless the context allows it.
    fn environment(&self, _context: &Context<'_>, _complaints: &mut Complaints<'_>) {}

    /// Sizes among the options with the memory that they need at once in a study with so many unknowns, beside that of the
    /// results that the engine keeps; empty if no option asks for much.
    fn room(&self, _unknowns: usize) -> Vec<Size> {
        Vec::new()
    }

    /// Faults of a plugin that can fail where its interface has no room for errors; a plugin that calls others returns
    /// theirs.
    fn faults(&self) -> Vec<Arc<Fault>> {
        Vec::new()
    }

    /// Libraries of the plugins that this plugin calls, if its options choose some; its own library is not included.
    fn libraries(&self) -> Vec<&'static Library> {
        Vec::new()
    }

    /// Revisions of the plugins that this plugin calls, if its options choose some, by kind and name; its own revision
    /// is not included.
    fn revisions(&self) -> BTreeMap<String, u32> {
        BTreeMap::new()
    }
}

/// An option that sets the memory of a plugin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// Key of the option.
    pub key: &'static str,
    /// The objects that need the memory, as the subject of a message: `the samples`.
    pub what: &'static str,
    /// Value of the option.
    pub value: usize,
    /// Numbers of eight bytes that the plugin holds at least for each of them.
    pub numbers: usize,
}

/// One fact about a result: a row of a table in the report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fact {
    /// Name of the fact, such as `largest degree`.
    pub name: String,
    /// Value as text, including the unit.
    pub value: String,
}

impl Fact {
    /// A fact from its name and value.
    pub fn new(name: impl Into<String>, value: impl ToString) -> Self {
        Self { name: name.into(), value: value.to_string() }
    }
}
