//! Changes that a study needs to include an effect inside its model, or another model.

mod keys;
mod swap;
mod text;

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::amend::{Change, changed};
use lacuna::text::emit::{Unwritable, to_table};
use toml::{Table, Value};

pub use keys::with_keys;

/// Changes of a study.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Edit {
    /// New parameters.
    pub parameters: Vec<NewParameter>,
    /// Inputs that are no longer fixed.
    pub freed: Vec<String>,
    /// Options of `[model]` that change.
    pub model: Vec<Change>,
    /// The model that takes the place of the study's.
    pub swapped: Option<Swapped>,
}

/// Another model in place of the study's. The pieces that `[gap]` lists inside the study's own model are removed with
/// it.
#[derive(Debug, Clone, PartialEq)]
pub struct Swapped {
    /// The name in the study.
    pub name: String,
    /// The `[model]`.
    pub model: Table,
    /// The parameters of the study that it does not have.
    pub idle: Vec<String>,
}

/// A further `[[parameter]]`.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct NewParameter {
    /// The input of the model that it sets.
    pub name: String,
    /// The unit of its values.
    pub unit: Unit,
    /// The prior.
    pub prior: Distribution,
    /// The value at which the effect is absent.
    pub reference: f64,
}

impl Edit {
    /// Returns true if another model takes the place of the study's.
    pub fn is_swap(&self) -> bool {
        self.swapped.is_some()
    }

    /// The changes of both edits.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        self.parameters.extend(other.parameters);
        self.freed.extend(other.freed);
        self.model.extend(other.model);
        self.swapped = other.swapped.or(self.swapped);
        self
    }

    /// The study as a table (such as [`Study::resolved`](crate::study::Study::resolved)) after the changes.
    pub fn applied(&self, study: &Table) -> Result<Table, Unwritable> {
        let mut whole = study.clone();
        if let Some(model) = self.model_of(study) {
            whole.insert("model".to_owned(), model.into());
        }
        let mut parameters = match whole.get("parameter") {
            Some(Value::Array(all)) => all.clone(),
            _ => Vec::new(),
        };
        if let Some(swapped) = &self.swapped {
            parameters.retain(|parameter| {
                let name = parameter.get("name").and_then(Value::as_str);
                !name.is_some_and(|name| swapped.idle.iter().any(|idle| idle == name))
            });
        }
        for added in &self.parameters {
            parameters.push(to_table(added)?.into());
        }
        whole.insert("parameter".to_owned(), parameters.into());
        if let Some(Value::Table(gap)) = whole.get_mut("gap") {
            self.untried(gap);
        }
        Ok(whole)
    }

    /// Removes from `[gap]` the candidates that the edit adds to the study.
    fn untried(&self, gap: &mut Table) {
        if let Some(swapped) = &self.swapped {
            gap.remove("switch");
            gap.remove("term");
            if let Some(Value::Array(models)) = gap.get_mut("model") {
                models.retain(|m| m.get("name").and_then(Value::as_str) != Some(&swapped.name));
                if models.is_empty() {
                    gap.remove("model");
                }
            }
        }
        let called = |table: &Value, key: &str| {
            let name = table.get(key).and_then(Value::as_str);
            name.is_some_and(|name| self.freed.iter().any(|freed| freed == name))
        };
        let names = |table: &Value| {
            called(table, "name") || (table.get("name").is_none() && called(table, "use"))
        };
        for (list, is_added) in [
            ("switch", &(|table: &Value| called(table, "input")) as &dyn Fn(&Value) -> bool),
            ("term", &names),
        ] {
            let Some(Value::Array(all)) = gap.get_mut(list) else { continue };
            all.retain(|table| !is_added(table));
            if all.is_empty() {
                gap.remove(list);
            }
        }
    }

    /// The changed `[model]`; `None` if nothing changes in it.
    fn model_of(&self, study: &Table) -> Option<Table> {
        if let Some(swapped) = &self.swapped {
            return Some(swapped.model.clone());
        }
        let old = study.get("model").and_then(Value::as_table)?;
        let mut model = changed(old, &self.model);
        if let Some(Value::Table(fixed)) = model.get_mut("fixed") {
            self.freed.iter().for_each(|name| {
                fixed.remove(name);
            });
        }
        (model != *old).then_some(model)
    }
}
