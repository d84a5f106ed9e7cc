//! The options of a plugin that is not linked, as its schema describes them.

use lacuna::text::nearest::{nearest, one_of};
use lacuna::text::{Node, Problem, Problems};
use schemars::{Schema, SchemaGenerator};
use serde_json::{Map, Value as Json};

/// The prefix of references to definitions where a schema stands by itself.
const DEFINITIONS: &str = "#/$defs/";

/// The options of a plugin: the keys that its schema has.
pub struct Options {
    /// Without its definitions.
    schema: Map<String, Json>,
    definitions: Map<String, Json>,
    /// Kind and name of the plugin, which begin the names of definitions that others have too.
    plugin: String,
}

impl Options {
    /// Options of a schema that stands by itself.
    pub fn new(mut schema: Map<String, Json>, plugin: String) -> Self {
        let definitions = match schema.remove("$defs") {
            Some(Json::Object(definitions)) => definitions,
            _ => Map::new(),
        };
        Self { schema, definitions, plugin }
    }

    /// The schema as a part of one that others have a part in.
    pub fn schema(&self, generator: &mut SchemaGenerator) -> Schema {
        let known = generator.definitions().clone();
        // A definition that is the same everywhere keeps its name.
        let taken =
            |name: &String, definition: &Json| known.get(name).is_some_and(|k| k != definition);
        let renamed: Vec<&String> = (self.definitions.iter())
            .filter(|(name, definition)| taken(name, definition))
            .map(|(name, _)| name)
            .collect();
        let new = |name: &str| format!("{}.{name}", self.plugin);
        let rename = |name: &str| renamed.iter().any(|r| *r == name).then(|| new(name));
        for (name, definition) in &self.definitions {
            let mut definition = definition.clone();
            refer(&mut definition, &rename);
            let name = rename(name).unwrap_or_else(|| name.clone());
            generator.definitions_mut().insert(name, definition);
        }
        let mut schema = Json::Object(self.schema.clone());
        refer(&mut schema, &rename);
        Schema::try_from(schema).unwrap_or_default()
    }

    /// The schema with its own reference followed.
    fn whole(&self) -> &Map<String, Json> {
        let reference = self.schema.get("$ref").and_then(Json::as_str);
        let name = reference.and_then(|r| r.strip_prefix(DEFINITIONS));
        name.and_then(|name| self.definitions.get(name)?.as_object()).unwrap_or(&self.schema)
    }

    /// Complains of keys that are missing or that no plugin asks for; true where there are none.
    pub fn check(&self, node: &Node, beside: &[&str], problems: &mut Problems) -> bool {
        let before = problems.len();
        let whole = self.whole();
        let properties = whole.get("properties").and_then(Json::as_object);
        let known: Vec<&str> =
            properties.into_iter().flat_map(|p| p.keys().map(String::as_str)).collect();
        if whole.get("additionalProperties") == Some(&Json::Bool(false)) {
            for (key, _) in
                node.entries().iter().filter(|(key, _)| !known.contains(&key.name.as_str()))
            {
                let all = || known.iter().chain(beside).copied();
                let path = problems.path(&key.name);
                let message = format!("unknown key `{}`", key.name);
                let place = Some(key.place.clone());
                let problem = problems.push(Problem { place, path, ..Problem::new(message) });
                problem.expected(format!("one of {}", one_of(all())));
                if let Some(near) = nearest(&key.name, all()) {
                    problem.help(format!("did you mean `{near}`?"));
                }
            }
        }
        let required = whole.get("required").and_then(Json::as_array);
        let required = required.into_iter().flatten().filter_map(Json::as_str);
        for name in required.filter(|name| node.get(name).is_none()) {
            problems.report(Some(node.place.clone()), format!("missing key `{name}`"));
        }
        problems.len() == before
    }
}

/// Renames definitions wherever they are referred to.
fn refer(schema: &mut Json, rename: &impl Fn(&str) -> Option<String>) {
    match schema {
        Json::Object(object) => {
            for (key, value) in object.iter_mut() {
                match (key.as_str(), &value) {
                    ("$ref", Json::String(reference)) => {
                        let new = reference.strip_prefix(DEFINITIONS).and_then(rename);
                        if let Some(new) = new {
                            *value = Json::String(format!("{DEFINITIONS}{new}"));
                        }
                    }
                    _ => refer(value, rename),
                }
            }
        }
        Json::Array(elements) => elements.iter_mut().for_each(|element| refer(element, rename)),
        _ => {}
    }
}
