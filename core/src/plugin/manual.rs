//! A plugin's page of the manual, made from the schema of its options: the doc comments of the
//! options are the only place where they are described.

use std::collections::BTreeSet;

use schemars::generate::SchemaSettings;
use schemars::{Schema, SchemaGenerator};
use serde_json::{Map, Value};

mod render;
mod types;

/// A plugin's page.
#[derive(Clone, Debug, PartialEq)]
pub struct Manual {
    /// `surrogate.polynomial_chaos`
    pub name: String,
    /// The first sentence or line of the documentation.
    pub title: String,
    /// The rest of the documentation, as Markdown.
    pub prose: String,
    /// The options in the order of the plugin's own struct, those inside a table after it.
    pub options: Vec<OptionManual>,
}

/// One option of a plugin.
#[derive(Clone, Debug, PartialEq)]
pub struct OptionManual {
    /// Dotted path within the section, such as `degree.max`.
    pub key: String,
    /// What it is, in words: `a number above 0`.
    pub kind: String,
    /// The default as TOML; `None` when there is none.
    pub default: Option<String>,
    /// True when it must be given.
    pub required: bool,
    /// Its documentation, as Markdown.
    pub text: String,
    /// The values to choose from, with their documentation.
    pub choices: Vec<Choice>,
}

/// One value to choose from.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// As a study writes it: `"leave_one_out"` or `{ uniform = … }`; or in words: `a table`.
    pub written: String,
    /// Whether it is written like this, not in words.
    pub literal: bool,
    /// Its documentation.
    pub text: String,
}

/// The generator whose schemas the manual and the editors' schema are made from.
pub(crate) fn generator() -> SchemaGenerator {
    SchemaSettings::draft2020_12().for_deserialize().into_generator()
}

/// A schema as an object, a reference to a definition followed.
pub(crate) fn resolve(schema: &Schema, generator: &SchemaGenerator) -> Map<String, Value> {
    schema.as_object().map(|object| follow(object, generator)).unwrap_or_default()
}

/// How many references lead one to another; more of them go round in a circle.
const LONGEST: usize = 32;

/// Follows a reference; what stands beside it (description, default) is kept.
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
    pub(crate) fn of_schema(
        name: &str,
        schema: &Map<String, Value>,
        generator: &SchemaGenerator,
    ) -> Self {
        let (title, prose) = title_and_prose(text(schema, "description"));
        let mut collector = Collector { generator, open: BTreeSet::new(), options: Vec::new() };
        collector.table("", schema);
        Self { name: name.to_owned(), title, prose, options: collector.options }
    }
}

/// The first paragraph up to its first full stop, and what follows.
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

/// Walks the schema of options and the tables in it.
struct Collector<'g> {
    generator: &'g SchemaGenerator,
    /// Types that the walk is inside of, which must not be entered again.
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
