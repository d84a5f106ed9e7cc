//! The JSON Schema (2020-12) of the study language, installed plugins included, for editors.

use std::collections::BTreeSet;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde_json::{Map, Value, json};

use crate::plugin::manual::{Manual, generator, resolve};
use crate::plugin::registry::{Kind, entries};

/// The schema of a section that chooses a plugin: one case a plugin, with the engine's keys `C`.
pub fn section<K: Kind + ?Sized, C: JsonSchema>(generator: &mut SchemaGenerator) -> Schema {
    let common = generator.subschema_for::<C>();
    let common = resolve(&common, generator);
    let cases: Vec<Value> = entries::<K>()
        .into_iter()
        .map(|entry| {
            let options = (entry.schema)(generator);
            let mut case = resolve(&options, generator);
            let title = entry.full_name();
            let manual = Manual::of_schema(&title, &case, generator);
            complete(&mut case, &common, entry.name, &manual);
            Value::Object(case)
        })
        .collect();
    let description = format!("Chooses a {} with `use`; the other keys are its options.", K::NAME);
    let mut schema = json!({ "type": "object", "description": description });
    // Without a plugin nothing is right, and an empty `oneOf` is no schema.
    schema["oneOf"] = if cases.is_empty() { json!([false]) } else { Value::Array(cases) };
    Schema::try_from(schema).unwrap_or_default()
}

/// Adds `use` and the engine's keys to the schema of a plugin's options.
fn complete(
    case: &mut Map<String, Value>,
    common: &Map<String, Value>,
    name: &str,
    manual: &Manual,
) {
    let table = |map: &Map<String, Value>, key: &str| {
        map.get(key).and_then(Value::as_object).cloned().unwrap_or_default()
    };
    let list = |map: &Map<String, Value>, key: &str| {
        map.get(key).and_then(Value::as_array).cloned().unwrap_or_default()
    };
    let mut properties = Map::new();
    properties.insert("use".to_owned(), json!({ "const": name, "description": manual.title }));
    properties.extend(table(common, "properties"));
    properties.extend(table(case, "properties"));
    let mut required = vec![json!("use")];
    required.extend(list(common, "required"));
    required.extend(list(case, "required"));
    case.insert("title".to_owned(), json!(name));
    case.insert("type".to_owned(), json!("object"));
    case.insert("properties".to_owned(), Value::Object(properties));
    case.insert("required".to_owned(), Value::Array(required));
    case.insert("additionalProperties".to_owned(), json!(false));
}

/// Assembles the schema of a whole study, section by section, in the order of the manual.
pub struct Language {
    generator: SchemaGenerator,
    properties: Map<String, Value>,
    required: Vec<Value>,
}

impl Default for Language {
    fn default() -> Self {
        Self::new()
    }
}

impl Language {
    /// A language that knows `extends` only.
    pub fn new() -> Self {
        let extends = json!({
            "type": "string",
            "description": "A study, relative to this file, of which this one says what differs.",
        });
        let mut properties = Map::new();
        properties.insert("extends".to_owned(), extends);
        Self { generator: generator(), properties, required: Vec::new() }
    }

    /// A section with fixed keys: `[study]`.
    pub fn table<T: JsonSchema>(&mut self, name: &str) -> &mut Self {
        let schema = self.generator.subschema_for::<T>();
        self.property(name, schema.to_value())
    }

    /// A list of tables with fixed keys: `[[parameter]]`.
    pub fn tables<T: JsonSchema>(&mut self, name: &str) -> &mut Self {
        let items = self.generator.subschema_for::<T>();
        self.property(name, json!({ "type": "array", "items": items }))
    }

    /// A section that chooses a plugin: `[surrogate]`.
    pub fn section<K: Kind + ?Sized, C: JsonSchema>(&mut self, name: &str) -> &mut Self {
        let schema = section::<K, C>(&mut self.generator);
        self.property(name, schema.to_value())
    }

    /// A list of tables each of which chooses a plugin: `[[effect]]`.
    pub fn sections<K: Kind + ?Sized, C: JsonSchema>(&mut self, name: &str) -> &mut Self {
        let items = section::<K, C>(&mut self.generator);
        self.property(name, json!({ "type": "array", "items": items }))
    }

    /// A list of tables inside a section, each of which chooses a plugin: `[[gap.candidate]]`.
    pub fn sections_in<K: Kind + ?Sized, C: JsonSchema>(
        &mut self,
        outer: &str,
        name: &str,
    ) -> &mut Self {
        let items = section::<K, C>(&mut self.generator).to_value();
        self.list_in(outer, name, &items)
    }

    /// A list of tables inside a section: `[[gap.switch]]`.
    pub fn tables_in<T: JsonSchema>(&mut self, outer: &str, name: &str) -> &mut Self {
        let items = self.generator.subschema_for::<T>().to_value();
        self.list_in(outer, name, &items)
    }

    fn list_in(&mut self, outer: &str, name: &str, items: &Value) -> &mut Self {
        // The outer section has keys of its own, whose schema stands among the definitions or here.
        let own = self.properties.remove(outer).unwrap_or_default();
        let mut whole = match own.get("$ref").and_then(Value::as_str) {
            Some(reference) => {
                let name = reference.rsplit('/').next().unwrap_or_default();
                self.generator.definitions().get(name).cloned().unwrap_or_default()
            }
            None => own,
        };
        whole["properties"][name] = json!({ "type": "array", "items": items });
        self.property(outer, whole)
    }

    /// Says that every study has this section, itself or by what it extends.
    pub fn required(&mut self, name: &str) -> &mut Self {
        self.required.push(json!(name));
        self
    }

    fn property(&mut self, name: &str, schema: Value) -> &mut Self {
        self.properties.insert(name.to_owned(), schema);
        self
    }

    /// The whole schema.
    pub fn finish(mut self) -> Value {
        let required: Vec<&str> = self.required.iter().filter_map(Value::as_str).collect();
        for (name, schema) in &mut self.properties {
            if name != "extends" && !required.contains(&name.as_str()) {
                removable(schema);
            }
        }
        let mut definitions = self.generator.take_definitions(true);
        let mut whole = json!({
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "title": "Lacuna study",
            "type": "object",
            "properties": self.properties,
            "additionalProperties": false,
        });
        if !self.required.is_empty() {
            // A study that extends another may leave out what the other has.
            whole["anyOf"] = json!([{ "required": ["extends"] }, { "required": self.required }]);
        }
        let used = used(&whole, &definitions);
        definitions.retain(|name, _| used.contains(name));
        if !definitions.is_empty() {
            whole["$defs"] = Value::Object(definitions);
        }
        without_machine_formats(&mut whole);
        whole
    }
}

/// Lets `false` stand in the place of a section that a study may do without; see `extends`.
fn removable(schema: &mut Value) {
    let none =
        json!({ "const": false, "description": "Takes the section out that another study has." });
    match schema {
        // A section that chooses a plugin has a case for each.
        Value::Object(own)
            if own.get("oneOf").and_then(Value::as_array).is_some_and(|o| o.len() > 1) =>
        {
            own.remove("type");
            if let Some(Value::Array(cases)) = own.get_mut("oneOf") {
                cases.push(none);
            }
        }
        Value::Object(own) if own.contains_key("oneOf") => {}
        other => *other = json!({ "anyOf": [other.clone(), none] }),
    }
}

/// The definitions that are referred to, directly or by another that is.
fn used(whole: &Value, definitions: &Map<String, Value>) -> BTreeSet<String> {
    let mut used = BTreeSet::new();
    let mut unread = vec![whole];
    while let Some(schema) = unread.pop() {
        let name = schema.get("$ref").and_then(Value::as_str).and_then(|r| r.rsplit('/').next());
        if let Some(name) = name.filter(|name| used.insert((*name).to_owned())) {
            unread.extend(definitions.get(name));
        }
        match schema {
            Value::Object(object) => unread.extend(object.values()),
            Value::Array(array) => unread.extend(array),
            _ => {}
        }
    }
    used
}

/// Removes `"format": "uint"` and the like, which no editor knows.
fn without_machine_formats(schema: &mut Value) {
    const FORMATS: [&str; 12] = [
        "uint", "uint8", "uint16", "uint32", "uint64", "int", "int8", "int16", "int32", "int64",
        "float", "double",
    ];
    match schema {
        Value::Object(object) => {
            let format = object.get("format").and_then(Value::as_str);
            if format.is_some_and(|format| FORMATS.contains(&format)) {
                object.remove("format");
            }
            object.values_mut().for_each(without_machine_formats);
        }
        Value::Array(array) => array.iter_mut().for_each(without_machine_formats),
        _ => {}
    }
}

#[cfg(test)]
mod tests;
