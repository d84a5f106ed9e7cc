//! JSON Schema (draft 7, the newest that TOML editors support) of a section that chooses a plugin.

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde_json::{Map, Value, json};

use super::manual::{Manual, resolve};
use super::registry::{Entry, Kind, entries};

/// Returns the schema of a section that chooses a plugin: `use` determines which options are allowed beside the
/// engine's keys `C`.
///
/// The options of a plugin are a definition of the generator, such as `sampler.metropolis`, to which all sections of
/// its kind refer. `if` and `then` distinguish the cases, so that a validator names the wrong key of the chosen plugin.
/// Editors complete keys from `anyOf`, whose last case always holds so that it rejects nothing.
pub fn section<K: Kind + ?Sized, C: JsonSchema>(generator: &mut SchemaGenerator) -> Schema {
    let common = generator.subschema_for::<C>();
    let common = resolve(&common, generator);
    let mut plugins: Vec<Options> =
        entries::<K>().into_iter().map(|entry| Options::define(entry, generator)).collect();
    plugins.dedup_by(|next, before| next.name == before.name);
    let names: Vec<&str> = plugins.iter().map(|plugin| plugin.name).collect();
    // Without a plugin no name is right.
    let chosen = if names.is_empty() { json!(false) } else { json!({ "enum": names }) };
    let mut properties = Map::from_iter([("use".to_owned(), chosen)]);
    properties.extend(table(&common, "properties"));
    let own: Vec<String> = properties.keys().cloned().collect();
    let mut required = vec![json!("use")];
    required.extend(list(&common, "required"));
    let mut examples: Vec<Value> = plugins.iter().map(Options::reference).collect();
    examples.push(json!(true));
    let mut cases: Vec<Value> = plugins.iter().map(|plugin| plugin.case(&own)).collect();
    cases.extend(of_no_plugin(&own, &plugins));
    let description =
        format!("Selects the {} by `use`; the other keys are the options of the plugin.", K::NAME);
    let schema = json!({
        "type": "object",
        "description": description,
        "properties": properties,
        "required": required,
        "anyOf": examples,
        "allOf": cases,
    });
    Schema::try_from(schema).unwrap_or_default()
}

/// Options of a plugin, one case of a section's schema.
struct Options {
    name: &'static str,
    /// Name of the definition of the options.
    definition: String,
    /// All keys; `None` if further keys are allowed.
    keys: Option<Vec<String>>,
}

impl Options {
    /// Adds the definition of a plugin's options.
    fn define<K: Kind + ?Sized>(entry: &Entry<K>, generator: &mut SchemaGenerator) -> Self {
        let options = (entry.schema)(generator);
        let mut options = resolve(&options, generator);
        let definition = entry.full_name();
        let manual = Manual::of_schema(&definition, &options, generator);
        let own = table(&options, "properties");
        let closed = options.remove("additionalProperties") == Some(json!(false));
        let keys = closed.then(|| own.keys().cloned().collect());
        let chosen = json!({ "const": entry.name, "description": manual.title });
        let mut properties = Map::from_iter([("use".to_owned(), chosen)]);
        properties.extend(own);
        // The section says that it is a table.
        options.remove("type");
        options.insert("title".to_owned(), json!(entry.name));
        // The whole text is the manual's.
        if let Some(Value::String(text)) = options.get_mut("description") {
            text.truncate(text.find("\n\n").unwrap_or(text.len()));
        }
        options.insert("properties".to_owned(), Value::Object(properties));
        generator.definitions_mut().insert(definition.clone(), Value::Object(options));
        Self { name: entry.name, definition, keys }
    }

    fn reference(&self) -> Value {
        json!({ "$ref": format!("#/$defs/{}", self.definition) })
    }

    /// Case of a section that chooses this plugin and has the engine's keys `own`.
    fn case(&self, own: &[String]) -> Value {
        let chosen =
            json!({ "properties": { "use": { "const": self.name } }, "required": ["use"] });
        let then = match &self.keys {
            Some(keys) => json!({ "allOf": [self.reference(), closed(own, keys)] }),
            None => self.reference(),
        };
        json!({ "if": chosen, "then": then })
    }
}

/// Case of a section that names no plugin, because it takes the default or changes another study: the keys of any
/// plugin are allowed.
fn of_no_plugin(own: &[String], plugins: &[Options]) -> Option<Value> {
    let keys: Option<Vec<&Vec<String>>> =
        plugins.iter().map(|plugin| plugin.keys.as_ref()).collect();
    let closed = closed(own, keys?.into_iter().flatten());
    Some(json!({ "if": { "not": { "required": ["use"] } }, "then": closed }))
}

/// Schema that allows the keys `own` and `keys` only.
fn closed<'a>(own: &'a [String], keys: impl IntoIterator<Item = &'a String>) -> Value {
    let all = own.iter().chain(keys).map(|key| (key.clone(), json!(true)));
    let all: Map<String, Value> = all.collect();
    json!({ "properties": all, "additionalProperties": false })
}

fn table(map: &Map<String, Value>, key: &str) -> Map<String, Value> {
    map.get(key).and_then(Value::as_object).cloned().unwrap_or_default()
}

fn list(map: &Map<String, Value>, key: &str) -> Vec<Value> {
    map.get(key).and_then(Value::as_array).cloned().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::manual::generator;
    use super::super::registry::tests::{Concert, Instrument};
    use super::*;

    #[test]
    fn a_section_has_one_case_a_plugin() {
        let mut generator = generator();
        let schema = section::<dyn Instrument, Concert>(&mut generator).to_value();
        assert_eq!(schema["required"], json!(["use"]));
        assert_eq!(schema["properties"]["audience"]["type"], "integer");
        let cases = schema["allOf"].as_array().unwrap();
        let case = |name: &str| {
            cases.iter().find(|case| case["if"]["properties"]["use"]["const"] == name).unwrap()
        };
        let whistle = &case("whistle")["then"]["allOf"];
        assert_eq!(whistle[0]["$ref"], "#/$defs/instrument.whistle");
        assert_eq!(whistle[1]["additionalProperties"], false);
        let keys = whistle[1]["properties"].as_object().unwrap().keys();
        let keys: Vec<&str> = keys.map(String::as_str).collect();
        assert_eq!(keys, ["use", "audience", "volume", "holes", "tuning", "case"]);
        let whistle = &generator.definitions()["instrument.whistle"];
        assert_eq!(whistle["properties"]["use"]["const"], "whistle");
        assert_eq!(whistle["properties"]["use"]["description"], "A whistle.");
        assert_eq!(whistle["properties"]["volume"]["maximum"], 1);
        assert_eq!(whistle["required"], Value::Null);
        let drum = &generator.definitions()["instrument.drum"];
        assert_eq!(drum["required"], json!(["sticks"]));
        // Every name once, and what an editor completes. A drum may have further keys, and so may a section without `use`.
        let names = schema["properties"]["use"]["enum"].as_array().unwrap();
        assert_eq!(cases.len(), names.len());
        assert_eq!(schema["anyOf"].as_array().unwrap().len(), names.len() + 1);
        assert_eq!(schema["anyOf"][names.len()], true);
    }
}
