#![allow(clippy::unwrap_used)]

use serde::Deserialize;

use super::*;
use crate::plugin::Design;
use crate::plugin::registry::NoKeys;
use crate::study::values::{Name, Positive};

/// What is unknown.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[allow(dead_code)]
struct Unknown {
    /// Its name.
    name: Name,
    #[serde(default)]
    scale: Option<Positive>,
}

#[test]
fn the_whole_language_is_one_schema() {
    let mut language = Language::new();
    language.tables::<Unknown>("parameter").required("parameter");
    language.section::<dyn Design, NoKeys>("design");
    let schema = language.finish();
    assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
    assert_eq!(schema["additionalProperties"], false);
    assert_eq!(schema["anyOf"][1]["required"], json!(["parameter"]));
    assert_eq!(schema["properties"]["parameter"]["items"]["$ref"], "#/$defs/Unknown");
    let unknown = &schema["$defs"]["Unknown"];
    assert_eq!(unknown["required"], json!(["name"]));
    assert_eq!(unknown["properties"]["name"]["pattern"], "^[A-Za-z_][A-Za-z0-9_]*$");
    assert_eq!(schema["$defs"].as_object().unwrap().len(), 1);
    assert!(!schema.to_string().contains("\"format\""));
    // The engine alone has no design.
    assert_eq!(schema["properties"]["design"]["oneOf"], json!([false]));
}

#[test]
fn a_section_has_one_case_a_plugin() {
    use crate::plugin::registry::tests::{Concert, Instrument};
    let mut generator = generator();
    let schema = section::<dyn Instrument, Concert>(&mut generator).to_value();
    let cases = schema["oneOf"].as_array().unwrap();
    let whistle = cases.iter().find(|case| case["title"] == "whistle").unwrap();
    assert_eq!(whistle["properties"]["use"]["const"], "whistle");
    assert_eq!(whistle["properties"]["use"]["description"], "A whistle.");
    assert_eq!(whistle["properties"]["audience"]["type"], "integer");
    assert_eq!(whistle["properties"]["volume"]["maximum"], 1);
    assert_eq!(whistle["required"], json!(["use"]));
    assert_eq!(whistle["additionalProperties"], false);
    let drum = cases.iter().find(|case| case["title"] == "drum").unwrap();
    assert_eq!(drum["required"], json!(["use", "sticks"]));
}
