//! The JSON Schema (2020-12) of `summary.json`.

use schemars::generate::SchemaSettings;
use schemars::transform::{RecursiveTransform, Transform};
use schemars::{JsonSchema, Schema};
use serde_json::{Map, Value, json};

use super::Summary;

/// Name of the definition of a number that is not declared a [`Quantity`](super::Quantity).
pub const NUMBER: &str = "Number";

/// JSON Schema of `summary.json` (`lacuna schema summary`).
pub fn schema() -> Value {
    schema_of::<Summary>()
}

/// JSON Schema of a struct as it is written: it is closed (undescribed keys are not allowed), keys that may be absent
/// are not required, and numbers that are not finite are `null`.
pub fn schema_of<T: JsonSchema>() -> Value {
    let settings = SchemaSettings::draft2020_12().for_serialize();
    let mut schema = settings.into_generator().into_root_schema_for::<T>();
    RecursiveTransform(as_written).transform(&mut schema);
    let mut whole = schema.to_value();
    whole["$defs"][NUMBER] = json!({
        "description": "A number; `null` where it is not finite.",
        "type": ["number", "null"],
    });
    whole
}

fn as_written(schema: &mut Schema) {
    let Some(object) = schema.as_object_mut() else { return };
    close(object);
    let is_number = object.get("type").is_some_and(|kind| kind == "number");
    if is_number {
        object.remove("type");
        object.insert("$ref".to_owned(), json!(format!("#/$defs/{NUMBER}")));
    }
    // No validator knows `double`, `uint` and the like.
    object.remove("format");
}

/// Closes an object; keys that may be absent no longer allow `null`.
fn close(object: &mut Map<String, Value>) {
    let required: Vec<String> = match object.get("required").and_then(Value::as_array) {
        Some(names) => names.iter().filter_map(|n| n.as_str().map(str::to_owned)).collect(),
        None => Vec::new(),
    };
    let Some(Value::Object(properties)) = object.get_mut("properties") else { return };
    for (name, property) in properties {
        if !required.contains(name) {
            without_null(property);
        }
    }
    object.entry("additionalProperties").or_insert(json!(false));
}

/// Removes `null` from the values that a schema allows.
fn without_null(schema: &mut Value) {
    let Value::Object(object) = schema else { return };
    if let Some(Value::Array(kinds)) = object.get_mut("type") {
        kinds.retain(|kind| kind != "null");
        if let [only] = &kinds[..] {
            let only = only.clone();
            object.insert("type".to_owned(), only);
        }
    }
    let of_two = object.get("anyOf").and_then(Value::as_array).filter(|cases| {
        cases.len() == 2 && cases[1].get("type").is_some_and(|kind| kind == "null")
    });
    let other = of_two.and_then(|cases| cases[0].as_object().cloned());
    if let Some(other) = other {
        object.remove("anyOf");
        object.extend(other.into_iter().filter(|(key, _)| key != "description"));
    }
}
