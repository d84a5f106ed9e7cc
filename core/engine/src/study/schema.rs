//! The JSON Schema of the study language, installed plugins included, for editors.
//!
//! It keeps to draft 7, the newest that editors of TOML read. What a validator says names the key that is wrong: choices are
//! told apart by the name of a plugin, the type of the value or the key of a table (`alternatives`). A study that extends
//! another may leave anything out, so that the keys that must be there are listed apart (`complete`).

mod alternatives;
mod complete;

use std::collections::BTreeSet;

use lacuna::plugin::manual::{Manual, generator, resolve};
use lacuna::plugin::registry::Kind;
use lacuna::plugin::schema::section;
use schemars::{JsonSchema, SchemaGenerator};
use serde_json::{Map, Value, json};

use super::file::OPTIONAL;
use alternatives::Plain;

/// Assembles the schema of a whole study, section by section, in the order of the manual.
pub struct Language {
    generator: SchemaGenerator,
    properties: Map<String, Value>,
    required: Vec<Value>,
    /// Sections that are required where the other is not there.
    required_without: Vec<(String, String)>,
    /// Sections with the plugin that they have when they name none.
    defaults: Vec<(String, &'static str)>,
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
        Self {
            generator: generator(),
            properties,
            required: Vec::new(),
            required_without: Vec::new(),
            defaults: Vec::new(),
        }
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

    /// A section that chooses a plugin: `[surrogate]`; `default` is that of a study that chooses none.
    pub fn section<K: Kind + ?Sized, C: JsonSchema>(
        &mut self,
        name: &str,
        default: Option<&'static str>,
    ) -> &mut Self {
        let schema = section::<K, C>(&mut self.generator);
        self.defaults.extend(default.map(|plugin| (name.to_owned(), plugin)));
        self.property(name, schema.to_value())
    }

    /// A list of tables each of which chooses a plugin: `[[effect]]`.
    pub fn sections<K: Kind + ?Sized, C: JsonSchema>(&mut self, name: &str) -> &mut Self {
        let items = section::<K, C>(&mut self.generator);
        self.property(name, json!({ "type": "array", "items": items }))
    }

    /// A table inside a section that chooses a plugin: `[numerical_error.surrogate]`.
    pub fn section_in<K: Kind + ?Sized, C: JsonSchema>(
        &mut self,
        outer: &str,
        name: &str,
    ) -> &mut Self {
        let inner = section::<K, C>(&mut self.generator).to_value();
        self.inside(outer, name, inner)
    }

    /// A list of tables inside a section, each of which chooses a plugin: `[[gap.candidate]]`.
    pub fn sections_in<K: Kind + ?Sized, C: JsonSchema>(
        &mut self,
        outer: &str,
        name: &str,
    ) -> &mut Self {
        let items = section::<K, C>(&mut self.generator).to_value();
        self.inside(outer, name, json!({ "type": "array", "items": items }))
    }

    /// A list of tables inside a section: `[[gap.switch]]`.
    pub fn tables_in<T: JsonSchema>(&mut self, outer: &str, name: &str) -> &mut Self {
        let items = self.generator.subschema_for::<T>().to_value();
        self.inside(outer, name, json!({ "type": "array", "items": items }))
    }

    fn inside(&mut self, outer: &str, name: &str, mut inner: Value) -> &mut Self {
        let mut whole = self.properties.remove(outer).unwrap_or_default();
        // The keys of the outer section stand among the definitions or here.
        let definition = whole.get("$ref").and_then(Value::as_str).and_then(name_of);
        let definition = definition.map(str::to_owned);
        let own = match &definition {
            Some(definition) => self.generator.definitions_mut().get_mut(definition),
            None => Some(&mut whole),
        };
        if let Some(own) = own {
            if let Some(text) = own.pointer(&format!("/properties/{name}/description")) {
                inner["description"] = text.clone();
            }
            own["properties"][name] = inner;
        }
        self.property(outer, whole)
    }

    /// Says that every study has this section, itself or by what it extends.
    pub fn required(&mut self, name: &str) -> &mut Self {
        self.required.push(json!(name));
        self
    }

    /// Says that every study has this section but those with the other.
    pub fn required_without(&mut self, name: &str, other: &str) -> &mut Self {
        self.required_without.push((name.to_owned(), other.to_owned()));
        self
    }

    fn property(&mut self, name: &str, schema: Value) -> &mut Self {
        self.properties.insert(name.to_owned(), schema);
        self
    }

    /// The whole schema.
    pub fn finish(mut self) -> Value {
        let mut definitions = self.generator.take_definitions(true);
        let mut properties = Value::Object(self.properties);
        let raw = definitions.clone();
        let plain = Plain::new(&raw);
        plain.rewrite(&mut properties);
        definitions.values_mut().for_each(|definition| plain.rewrite(definition));

        let required: Vec<&str> = self.required.iter().filter_map(Value::as_str).collect();
        for (name, schema) in properties.as_object_mut().into_iter().flatten() {
            if name != "extends" && !required.contains(&name.as_str()) {
                removable(schema, &mut definitions);
            }
        }
        for (section, key) in OPTIONAL {
            if let Some(schema) = properties.pointer_mut(&format!("/{section}/properties/{key}")) {
                removable(schema, &mut definitions);
            }
        }

        let mut whole = json!({
            "$schema": "http://json-schema.org/draft-07/schema#",
            "title": "Lacuna study",
            "type": "object",
            "properties": properties,
            "required": self.required,
            "additionalProperties": false,
        });
        // A study that extends another may leave out what the other has.
        let mut complete = complete::split(&mut whole, &mut definitions);
        for (section, plugin) in &self.defaults {
            complete::default_plugin(&mut complete, section, plugin, &whole);
        }
        for (name, other) in &self.required_without {
            complete::required_without(&mut complete, name, other);
        }
        whole["if"] = json!({ "not": { "required": ["extends"] } });
        whole["then"] = complete;

        let used = used(&whole, &definitions);
        definitions.retain(|name, _| used.contains(name));
        if !definitions.is_empty() {
            whole["$defs"] = Value::Object(definitions);
        }
        without_machine_formats(&mut whole);
        with_infinite_bounds(&mut whole);
        whole
    }
}

/// The page of the manual of a table with fixed keys.
pub(super) fn page<T: JsonSchema>(name: &str) -> Manual {
    let mut generator = generator();
    let schema = generator.subschema_for::<T>();
    Manual::of_schema(name, &resolve(&schema, &generator), &generator)
}

/// Lets `false` stand in the place of a table that a study may do without; see `extends`. The other keywords say something of
/// tables and lists only.
fn removable(schema: &mut Value, definitions: &mut Map<String, Value>) {
    let kind = match schema.get("$ref").and_then(Value::as_str).and_then(name_of) {
        Some(name) => definitions.get_mut(name).and_then(|own| own.as_object_mut()?.remove("type")),
        None => schema.get("type").cloned(),
    };
    if let Some(reference) = schema.as_object_mut().and_then(|own| own.remove("$ref")) {
        schema["allOf"] = json!([{ "$ref": reference }]);
    }
    schema["type"] = json!([kind.unwrap_or(json!("object")), "boolean"]);
    schema["not"] = json!({ "const": true });
}

/// The name of the definition that a reference leads to.
fn name_of(reference: &str) -> Option<&str> {
    reference.strip_prefix("#/$defs/")
}

/// The definitions that are referred to, directly or by another that is.
fn used(whole: &Value, definitions: &Map<String, Value>) -> BTreeSet<String> {
    let mut used = BTreeSet::new();
    let mut unread = vec![whole];
    while let Some(schema) = unread.pop() {
        let name = schema.get("$ref").and_then(Value::as_str).and_then(name_of);
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

/// Lets bounds of truncated distributions be `inf`, which editors of TOML give to a validator as null.
fn with_infinite_bounds(schema: &mut Value) {
    match schema {
        Value::Object(object) => {
            if let Some(kind) = object
                .get_mut("truncated_normal")
                .and_then(|numbers| numbers.pointer_mut("/items/type"))
            {
                *kind = json!(["number", "null"]);
            }
            object.values_mut().for_each(with_infinite_bounds);
        }
        Value::Array(array) => array.iter_mut().for_each(with_infinite_bounds),
        _ => {}
    }
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
