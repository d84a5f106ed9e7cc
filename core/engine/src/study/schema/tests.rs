#![allow(clippy::unwrap_used)]

use lacuna::plugin::Design;
use lacuna::plugin::registry::NoKeys;
use lacuna::text::values::{Name, Positive};
use serde::Deserialize;

use super::*;

/// An unknown parameter.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[allow(dead_code)]
struct Unknown {
    /// Name of the parameter.
    name: Name,
    #[serde(default)]
    scale: Option<Positive>,
}

/// The keys that must be there, wherever they are: `[parameter, parameter.items.name]`.
fn asked(schema: &Value, whole: &Value, path: &str, found: &mut Vec<String>) {
    if let Some(name) = schema["$ref"].as_str().and_then(name_of) {
        return asked(&whole["$defs"][name], whole, path, found);
    }
    let keys = schema["required"].as_array().into_iter().flatten();
    found.extend(keys.filter_map(Value::as_str).map(|key| format!("{path}{key}")));
    for (key, inner) in schema["properties"].as_object().into_iter().flatten() {
        asked(inner, whole, &format!("{path}{key}."), found);
    }
    if schema["items"].is_object() {
        asked(&schema["items"], whole, path, found);
    }
}

#[test]
fn the_whole_language_is_one_schema() {
    let mut language = Language::new();
    language.tables::<Unknown>("parameter").required("parameter");
    language.section::<dyn Design, NoKeys>("design", None);
    let schema = language.finish();
    assert_eq!(schema["$schema"], "http://json-schema.org/draft-07/schema#");
    assert_eq!(schema["additionalProperties"], false);
    assert_eq!(schema["properties"]["parameter"]["items"]["$ref"], "#/$defs/Unknown");
    let unknown = &schema["$defs"]["Unknown"];
    assert_eq!(unknown["properties"]["name"]["pattern"], "^[A-Za-z_][A-Za-z0-9_]*$");
    assert!(unknown["properties"]["scale"].get("anyOf").is_none());
    assert!(!schema.to_string().contains("\"format\""));
    // The engine alone has no design, and a study may take out that of another.
    assert_eq!(schema["properties"]["design"]["properties"]["use"], false);
    assert_eq!(schema["properties"]["design"]["type"], json!(["object", "boolean"]));
}

#[test]
fn only_a_study_that_extends_none_must_be_complete() {
    let mut language = Language::new();
    language.tables::<Unknown>("parameter").required("parameter");
    language.section::<dyn Design, NoKeys>("design", None);
    let schema = language.finish();
    assert_eq!(schema["if"], json!({ "not": { "required": ["extends"] } }));
    let (mut always, mut alone) = (Vec::new(), Vec::new());
    let both = json!({ "required": schema["required"], "properties": schema["properties"] });
    asked(&both, &schema, "", &mut always);
    asked(&schema["then"], &schema, "", &mut alone);
    // An element of a list is known by its name.
    assert_eq!(always, ["parameter.name"]);
    assert_eq!(alone, ["parameter", "parameter.name", "design.use"]);
}
