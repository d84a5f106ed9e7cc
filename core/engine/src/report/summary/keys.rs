//! The keys of a schema as a list, for the reference and for tests.

use serde_json::Value;

use super::schema::NUMBER;

/// A key with its documentation.
#[derive(Debug, Clone, PartialEq)]
pub struct Key {
    /// Path from the top: `parameters.<name>.mean`, `gap.effects[].type`.
    pub path: String,
    /// JSON type in words: `number`, `list of strings`, `number or null`.
    pub kind: String,
    /// Meaning, as Markdown; empty if it is not documented.
    pub meaning: String,
    /// Values that the key can take, each with its meaning.
    pub choices: Vec<(String, String)>,
    /// True for a number that states an uncertainty or is used to judge one.
    pub is_claim: bool,
    /// Name of the definition of an object; objects with the same definition have the same keys.
    pub definition: Option<String>,
}

/// All keys of a schema in the order in which they are written; an object precedes its own keys.
///
/// The entries of a map are one key, `map.<name>`, and those of a list of objects another, `list[]`.
pub fn keys(schema: &Value) -> Vec<Key> {
    let mut list = List { root: schema, keys: Vec::new() };
    list.below("", schema);
    list.keys
}

struct List<'a> {
    root: &'a Value,
    keys: Vec<Key>,
}

impl<'a> List<'a> {
    /// Adds the keys of an object, or of all its cases; `path` is empty or ends in a full stop.
    fn below(&mut self, path: &str, object: &'a Value) {
        for case in std::iter::once(object).chain(cases(object)) {
            for (name, schema) in case["properties"].as_object().into_iter().flatten() {
                let path = format!("{path}{name}");
                match schema.get("const").and_then(Value::as_str) {
                    Some(word) => self.tag(&path, word, text(case)),
                    None => self.key(&path, schema, None),
                }
            }
        }
        if let Some(others) = object.get("additionalProperties").filter(|o| o.is_object()) {
            self.key(&format!("{path}<{}>", entry(object)), others, None);
        }
    }

    /// Adds a key with all keys below it. `outer` is the text of the map or list of which the key is an entry.
    fn key(&mut self, path: &str, schema: &'a Value, outer: Option<&str>) {
        let value = not_null(schema);
        let object = self.followed(value);
        // The documentation of a type is none of a key that has it.
        let meaning = outer.or_else(|| text(schema)).unwrap_or_default();
        if let Some(entries) = object.get("additionalProperties").filter(|_| is_map(object)) {
            self.key(&format!("{path}.<{}>", entry(object)), entries, Some(meaning));
        } else if let Some(items) = object.get("items").filter(|items| self.is_object(items)) {
            self.key(&format!("{path}[]"), items, Some(meaning));
        } else {
            let null = if may_be_null(schema) { " or `null`" } else { "" };
            self.add(Key {
                path: path.to_owned(),
                kind: format!("{}{null}", self.kind(value, "")),
                meaning: meaning.to_owned(),
                choices: choices(object),
                is_claim: is_claim(schema),
                definition: reference(value).filter(|_| self.is_object(value)).map(str::to_owned),
            });
            self.below(&format!("{path}."), object);
        }
    }

    /// Adds a key; several cases of an object may share a key, each with its own meaning.
    fn add(&mut self, key: Key) {
        match self.keys.iter_mut().find(|known| known.path == key.path) {
            Some(known) if known.meaning == key.meaning => {}
            Some(known) => known.meaning = format!("{} {}", known.meaning, key.meaning),
            None => self.keys.push(key),
        }
    }

    /// Adds the value by which the cases of an object are distinguished.
    fn tag(&mut self, path: &str, word: &str, meaning: Option<&str>) {
        let choice = (word.to_owned(), meaning.unwrap_or_default().to_owned());
        match self.keys.iter_mut().find(|known| known.path == path) {
            Some(known) => known.choices.push(choice),
            None => self.keys.push(Key {
                path: path.to_owned(),
                kind: "string".to_owned(),
                meaning: "Case, on which the other keys depend.".to_owned(),
                choices: vec![choice],
                is_claim: false,
                definition: None,
            }),
        }
    }

    /// A schema, or the definition that it refers to.
    fn followed(&self, schema: &'a Value) -> &'a Value {
        let name = reference(schema).unwrap_or_default();
        self.root["$defs"].get(name).unwrap_or(schema)
    }

    fn is_object(&self, schema: &'a Value) -> bool {
        let object = self.followed(schema);
        object.get("properties").is_some() || cases(object).next().is_some()
    }

    /// The JSON type in words, with `many` at the end of a noun.
    fn kind(&self, schema: &'a Value, many: &str) -> String {
        let object = self.followed(schema);
        if let Some(items) = object.get("items") {
            let count = match (object.get("minItems"), object.get("maxItems")) {
                (Some(least), Some(most)) if least == most => format!("{least} "),
                _ => String::new(),
            };
            return format!("list{many} of {count}{}", self.kind(items, "s"));
        }
        if let Some(items) = object.get("prefixItems").and_then(Value::as_array) {
            let kind = items.first().map(|item| self.kind(item, "s")).unwrap_or_default();
            return format!("list{many} of {} {kind}", items.len());
        }
        let name = match object.get("type") {
            Some(Value::String(name)) => name,
            Some(Value::Array(names)) => names[0].as_str().unwrap_or_default(),
            _ if self.is_object(schema) => "object",
            _ => "string",
        };
        format!("{name}{many}")
    }
}

/// The name of the definition that a schema refers to.
fn reference(schema: &Value) -> Option<&str> {
    schema.get("$ref")?.as_str()?.rsplit('/').next()
}

fn text(schema: &Value) -> Option<&str> {
    schema.get("description").and_then(Value::as_str)
}

/// The cases of an object that has several.
fn cases(object: &Value) -> impl Iterator<Item = &Value> {
    let all = object.get("oneOf").and_then(Value::as_array).into_iter().flatten();
    all.filter(|case| case.get("properties").is_some())
}

/// The word for the keys of a map, such as `parameter`.
fn entry(map: &Value) -> &str {
    map.pointer("/propertyNames/title").and_then(Value::as_str).unwrap_or_default()
}

/// Returns true for an object whose keys are names of the study instead of fixed keys of the schema.
fn is_map(object: &Value) -> bool {
    object.get("properties").is_none()
        && object.get("additionalProperties").is_some_and(Value::is_object)
}

fn is_null(schema: &Value) -> bool {
    schema.get("type").is_some_and(|kind| kind == "null")
}

fn alternatives(schema: &Value) -> impl Iterator<Item = &Value> {
    schema.get("anyOf").and_then(Value::as_array).into_iter().flatten()
}

/// The schema of a value that is not `null`.
fn not_null(schema: &Value) -> &Value {
    alternatives(schema).find(|case| !is_null(case)).unwrap_or(schema)
}

fn may_be_null(schema: &Value) -> bool {
    let kinds = schema.get("type").and_then(Value::as_array);
    kinds.is_some_and(|kinds| kinds.iter().any(|k| k == "null"))
        || alternatives(schema).any(is_null)
}

/// Returns true for a number, or a list of numbers, that is not declared a [`Quantity`](super::Quantity).
fn is_claim(schema: &Value) -> bool {
    if let Some(name) = reference(schema) {
        return name == NUMBER;
    }
    let kinds = schema.get("type").and_then(Value::as_array);
    let tuple = schema.get("prefixItems").and_then(Value::as_array).into_iter().flatten();
    kinds.is_some_and(|kinds| kinds.iter().any(|kind| kind == "number"))
        || schema.get("items").is_some_and(is_claim)
        || alternatives(schema).chain(tuple).any(is_claim)
}

/// The values that a key can take, each with its meaning.
fn choices(schema: &Value) -> Vec<(String, String)> {
    let words = |key: &str| schema.get(key).and_then(Value::as_array).into_iter().flatten();
    let described = words("oneOf").filter_map(|case| {
        let word = case.get("const")?.as_str()?;
        Some((word.to_owned(), text(case).unwrap_or_default().to_owned()))
    });
    let plain = words("enum").filter_map(|word| Some((word.as_str()?.to_owned(), String::new())));
    described.chain(plain).collect()
}
