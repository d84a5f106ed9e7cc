//! Manual page of a plugin, generated from the schema of its options: the doc comments of the options are the only
//! place where they are described.

use std::collections::BTreeSet;

use schemars::generate::SchemaSettings;
use schemars::{Schema, SchemaGenerator};
use serde_json::{Map, Value};

mod render;
mod types;

/// Manual page of a plugin.
#[derive(Clone, Debug, PartialEq)]
pub struct Manual {
    /// Full name, such as `surrogate.polynomial_chaos`.
    pub name: String,
    /// First sentence or line of the documentation.
    pub title: String,
    /// Rest of the documentation, as Markdown.
    pub prose: String,
    /// Options in the order of the plugin's own struct, those of a table after it.
    pub options: Vec<OptionManual>,
}

/// One option of a plugin.
#[derive(Clone, Debug, PartialEq)]
pub struct OptionManual {
    /// Dotted path within the section, such as `degree.max`.
    pub key: String,
    /// Description of the type, such as `a number above 0`.
    pub kind: String,
    /// Default as TOML; `None` if there is none.
    pub default: Option<String>,
    /// True if the option is required.
    pub required: bool,
    /// Documentation, as Markdown.
    pub text: String,
    /// Allowed values, with their documentation.
    pub choices: Vec<Choice>,
}

/// One allowed value.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The value as a study writes it: `"leave_one_out"` or `{ uniform = … }`; or a description: `a table`.
    pub written: String,
    /// True if `written` is literal, false if it is a description.
    pub literal: bool,
    /// Documentation of the value.
    pub text: String,
}

/// The generator of the schemas for the manual and for editors.
pub fn generator() -> SchemaGenerator {
    SchemaSettings::draft2020_12().for_deserialize().into_generator()
}

/// A schema as an object, with a reference to a definition resolved.
pub fn resolve(schema: &Schema, generator: &SchemaGenerator) -> Map<String, Value> {
    schema.as_object().map(|object| follow(object, generator)).unwrap_or_default()
}

/// Longest chain of references that is followed; a longer one is a cycle.
const LONGEST: usize = 32;

/// Follows a reference; keys beside it (description, default) are kept.
fn follow(object: &Map<String, Value>, generator: &SchemaGenerator) -> Map<String, Value> {
    follow_on(object, generator, LONGEST)
}

fn follow_on(
    object: &Map<String, Value>,
    generator: &SchemaGenerator,
    left: usize,
) -> Map<String, Value> {
    let Some(reference) = object.get("$ref").and_then(Value::as_str) else { return object.clone() };
    let name = reference.rsplit('/').next().unwrap_or(reference);
    let mut whole = match generator.definitions().get(name) {
        Some(Value::Object(definition)) if left > 0 => follow_on(definition, generator, left - 1),
        _ => Map::new(),
    };
    let beside = object.iter().filter(|(key, _)| key.as_str() != "$ref");
    whole.extend(beside.map(|(key, value)| (key.clone(), value.clone())));
    whole
}

impl Manual {
    /// The page of a plugin whose options have this schema.
    pub fn of_schema(name: &str, schema: &Map<String, Value>, generator: &SchemaGenerator) -> Self {
        let (title, prose) = title_and_prose(text(schema, "description"));
        let mut collector = Collector { generator, open: BTreeSet::new(), options: Vec::new() };
        collector.table("", schema);
        Self { name: name.to_owned(), title, prose, options: collector.options }
    }
}

/// The first paragraph up to its first full stop, and the rest.
fn title_and_prose(description: &str) -> (String, String) {
    let description = description.trim();
    let (paragraph, rest) = description.split_once("\n\n").unwrap_or((description, ""));
    let one_line = paragraph.split_whitespace().collect::<Vec<_>>().join(" ");
    match one_line.split_once(". ") {
        Some((title, more)) => (format!("{title}."), format!("{more}\n\n{rest}").trim().to_owned()),
        None => (one_line, rest.trim().to_owned()),
    }
}

fn text<'a>(schema: &'a Map<String, Value>, key: &str) -> &'a str {
    schema.get(key).and_then(Value::as_str).unwrap_or("")
}

/// Walks the schema of options and of the tables in it.
struct Collector<'g> {
    generator: &'g SchemaGenerator,
    /// Types that enclose the current position, which must not be entered again.
    open: BTreeSet<String>,
    options: Vec<OptionManual>,
}

impl Collector<'_> {
    fn table(&mut self, prefix: &str, schema: &Map<String, Value>) {
        let Some(properties) = schema.get("properties").and_then(Value::as_object) else { return };
        let required = schema.get("required").and_then(Value::as_array);
        for (name, property) in properties {
            let Some(written) = property.as_object() else { continue };
            let key = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
            let required = required.is_some_and(|names| names.iter().any(|n| n == name));
            self.option(key, required, written);
        }
    }

    fn option(&mut self, key: String, required: bool, written: &Map<String, Value>) {
        let schema = types::without_null(&follow(written, self.generator), self.generator);
        let default = written.get("default").or_else(|| schema.get("default"));
        self.options.push(OptionManual {
            key: key.clone(),
            kind: types::kind(&schema, self.generator),
            default: default.filter(|value| !value.is_null()).map(types::as_toml),
            required,
            text: text(&schema, "description").trim().to_owned(),
            choices: types::choices(&schema, self.generator),
        });
        let identity = Value::Object(schema.clone()).to_string();
        if self.open.insert(identity.clone()) {
            self.table(&key, &schema);
            for (variant, content) in types::variants_with_content(&schema, self.generator) {
                self.table(&format!("{key}.{variant}"), &content);
            }
            self.open.remove(&identity);
        }
    }
}

#[cfg(test)]
mod tests;
