//! The rest of the study, as a plugin sees it while it checks itself.

use std::path::PathBuf;

use lacuna::data::{Layout, Parameter, Scenario, Unit};
use lacuna::plugin::{Context, Given};
use serde::{Deserialize, Serialize};

/// A [`Context`] that owns its data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OwnedContext {
    directory: PathBuf,
    parameters: Vec<Parameter>,
    given: Vec<Set>,
    scenarios: Vec<Scenario>,
    layout: Layout,
    runs: Option<usize>,
    common_errors: bool,
    #[serde(default)]
    starts_programs: bool,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Set {
    name: String,
    unit: Option<Unit>,
}

impl From<&Context<'_>> for OwnedContext {
    fn from(context: &Context<'_>) -> Self {
        let set = |given: &Given| Set { name: given.name.clone(), unit: given.unit.clone() };
        Self {
            directory: context.directory.to_owned(),
            parameters: context.parameters.to_vec(),
            given: context.given.iter().map(set).collect(),
            scenarios: context.scenarios.to_vec(),
            layout: context.layout.clone(),
            runs: context.runs,
            common_errors: context.common_errors,
            starts_programs: context.starts_programs,
        }
    }
}

impl OwnedContext {
    /// Calls a function with the context as a borrowed view.
    pub fn with<R>(&self, look: impl FnOnce(&Context<'_>) -> R) -> R {
        let given = |set: &Set| Given { name: set.name.clone(), unit: set.unit.clone() };
        let given: Vec<Given> = self.given.iter().map(given).collect();
        look(&Context {
            directory: &self.directory,
            parameters: &self.parameters,
            given: &given,
            scenarios: &self.scenarios,
            layout: &self.layout,
            runs: self.runs,
            common_errors: self.common_errors,
            starts_programs: self.starts_programs,
        })
    }
}
