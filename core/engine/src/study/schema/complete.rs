//! The keys that a study must have: all at once, or together with the study that it extends.

use serde_json::{Map, Value, json};

use super::name_of;

/// Takes the keys that must be there out of a schema and its definitions, as far as tables with a header reach: they are
/// merged key by key with those of the study that is extended, and so are lists of tables with names. The schema that is
/// returned asks for these keys alone.
pub(super) fn split(schema: &mut Value, definitions: &mut Map<String, Value>) -> Value {
    let mut splitter = Splitter { definitions, seen: Map::new() };
    let complete = splitter.split(schema, false).unwrap_or_else(|| json!({}));
    let seen = splitter.seen;
    for (name, complete) in seen {
        definitions.insert(complete_name(&name), complete);
    }
    complete
}

fn complete_name(name: &str) -> String {
    format!("complete.{name}")
}

struct Splitter<'a> {
    definitions: &'a mut Map<String, Value>,
    /// Requirements taken out of each definition; null if there were none, or an empty object while they are being
    /// collected.
    seen: Map<String, Value>,
}

impl Splitter<'_> {
    /// Returns the requirements taken out of a schema, if any; `element` is true for an element of a list of named
    /// tables.
    fn split(&mut self, schema: &mut Value, element: bool) -> Option<Value> {
        let own = schema.as_object_mut()?;
        if let Some(name) = own.get("$ref").and_then(Value::as_str).and_then(name_of) {
            return self.reference(name, element);
        }
        let mut complete = Map::new();
        if let Some(Value::Array(mut keys)) = own.remove("required") {
            if !keys.is_empty() {
                complete.insert("required".to_owned(), Value::Array(keys.clone()));
            }
            // The name of an element says which one it is.
            keys.retain(|key| element && key == "name");
            if !keys.is_empty() {
                own.insert("required".to_owned(), Value::Array(keys));
            }
        }
        if let Some(properties) = self.each(own.get_mut("properties")) {
            complete.insert("properties".to_owned(), properties);
        }
        if let Some(inner) =
            own.get_mut("additionalProperties").and_then(|all| self.split(all, false))
        {
            complete.insert("additionalProperties".to_owned(), inner);
        }
        if self.are_named(own.get("items"))
            && let Some(inner) = own.get_mut("items").and_then(|items| self.split(items, true))
        {
            complete.insert("items".to_owned(), inner);
        }
        let cases = own.get_mut("allOf").and_then(Value::as_array_mut).into_iter().flatten();
        let cases: Vec<Value> = cases.filter_map(|case| self.case(case, element)).collect();
        if !cases.is_empty() {
            complete.insert("allOf".to_owned(), Value::Array(cases));
        }
        (!complete.is_empty()).then_some(Value::Object(complete))
    }

    fn each(&mut self, properties: Option<&mut Value>) -> Option<Value> {
        let properties = properties?.as_object_mut()?;
        let all: Map<String, Value> = properties
            .iter_mut()
            .filter_map(|(name, inner)| Some((name.clone(), self.split(inner, false)?)))
            .collect();
        (!all.is_empty()).then_some(Value::Object(all))
    }

    /// One of several that must hold; behind an `if` only what follows from it counts.
    fn case(&mut self, case: &mut Value, element: bool) -> Option<Value> {
        let Some(condition) = case.get("if").cloned() else { return self.split(case, element) };
        let then = self.split(case.get_mut("then")?, element)?;
        Some(json!({ "if": condition, "then": then }))
    }

    fn reference(&mut self, name: &str, element: bool) -> Option<Value> {
        if !self.seen.contains_key(name) {
            let mut definition = self.definitions.get(name)?.clone();
            self.seen.insert(name.to_owned(), json!({}));
            let complete = self.split(&mut definition, element);
            self.definitions.insert(name.to_owned(), definition);
            self.seen.insert(name.to_owned(), complete.unwrap_or(Value::Null));
        }
        let asks = self.seen.get(name).is_some_and(|complete| !complete.is_null());
        asks.then(|| json!({ "$ref": format!("#/$defs/{}", complete_name(name)) }))
    }

    /// Returns true if the elements of a list have names, by which they are merged.
    fn are_named(&self, items: Option<&Value>) -> bool {
        let Some(items) = items else { return false };
        let name = items.get("$ref").and_then(Value::as_str).and_then(name_of);
        let items = name.map_or(Some(items), |name| self.definitions.get(name));
        items.and_then(Value::as_object).is_some_and(has_name)
    }
}

/// Returns true if a table has a key `name`.
fn has_name(table: &Map<String, Value>) -> bool {
    table.get("properties").is_some_and(|keys| keys.get("name").is_some())
}

/// Asks of a section that names no plugin what is asked of one that names its default.
pub(super) fn default_plugin(complete: &mut Value, section: &str, plugin: &str, whole: &Value) {
    let own = &mut complete["properties"][section];
    let all = [&whole["properties"][section], &*own].map(|section| of_plugin(section, plugin));
    let all: Vec<Value> = all.into_iter().flatten().collect();
    if let Some(required) = own.get_mut("required").and_then(Value::as_array_mut) {
        required.retain(|key| key != "use");
    }
    // The default is not installed.
    if all.is_empty() {
        return;
    }
    let unnamed = json!({ "if": { "not": { "required": ["use"] } }, "then": { "allOf": all } });
    match own.get_mut("allOf").and_then(Value::as_array_mut) {
        Some(cases) => cases.push(unnamed),
        None => own["allOf"] = json!([unnamed]),
    }
}

/// Part of a section's schema that applies to one plugin.
fn of_plugin(section: &Value, plugin: &str) -> Option<Value> {
    let mut cases = section["allOf"].as_array().into_iter().flatten();
    let case = cases.find(|case| case["if"]["properties"]["use"]["const"] == plugin)?;
    Some(case["then"].clone())
}

/// Asks for a section where another is not there.
pub(super) fn required_without(complete: &mut Value, name: &str, other: &str) {
    complete["if"] = json!({ "not": { "required": [other] } });
    complete["then"] = json!({ "required": [name] });
}
