//! What a study must say besides for a piece that is missing inside its model.

use toml::{Table, Value};

use crate::data::Unit;
use crate::math::distribution::Distribution;
use crate::plugin::amend::{Change, changed};
use crate::study::emit::{Unwritable, to_table};

/// Changes of a study.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Edit {
    /// Unknowns that it has besides.
    pub parameters: Vec<Added>,
    /// Inputs that it fixes no longer.
    pub freed: Vec<String>,
    /// Options of `[model]` that become others.
    pub model: Vec<Change>,
    /// The model that takes the place of the study's.
    pub swapped: Option<Swapped>,
}

/// Another model in place of the study's. What the study says in `[gap]` of pieces inside its own model goes with that.
#[derive(Debug, Clone, PartialEq)]
pub struct Swapped {
    /// What the study calls it.
    pub name: String,
    /// Its `[model]`.
    pub model: Table,
    /// The parameters that it does not have.
    pub idle: Vec<String>,
}

/// A further `[[parameter]]`.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Added {
    /// The input of the model that it sets.
    pub name: String,
    /// The unit of its values.
    pub unit: Unit,
    /// Where the calibration looks.
    pub prior: Distribution,
    /// The value at which what it stands for is absent.
    pub reference: f64,
}

impl Edit {
    /// Whether another model takes the place of the study's.
    pub fn is_swap(&self) -> bool {
        self.swapped.is_some()
    }

    /// All changes of both.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        self.parameters.extend(other.parameters);
        self.freed.extend(other.freed);
        self.model.extend(other.model);
        self.swapped = other.swapped.or(self.swapped);
        self
    }

    /// The study as a table (such as [`Study::resolved`](crate::study::Study::resolved)) with the changes made.
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

    /// What is added is no candidate any more.
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

    /// `[model]` with the changes made; `None` where nothing of it changes.
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
