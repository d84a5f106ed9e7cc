//! Alternatives that a validator tells apart: `oneOf` and `anyOf` as one schema.
//!
//! A value that is wrong is "not valid under any of the given schemas" of an `anyOf`, which tells nobody what to change.
//! Alternatives of a study differ by their type (a number or a table), by the only key of a table (`{ uniform = [0, 1] }`)
//! or are plain words; each of these has a form that names the key or the word.

use std::cell::RefCell;

use serde_json::{Map, Value, json};

use super::name_of;

/// Maximum depth of nested alternatives and of chains of references.
const DEEPEST: usize = 16;

/// Keywords that do not constrain a value.
const ANNOTATIONS: [&str; 3] = ["title", "description", "default"];

/// Rewrites schemas that share definitions.
pub(super) struct Plain<'d> {
    definitions: &'d Map<String, Value>,
    /// The definitions that are being written out, which must not be entered again.
    open: RefCell<Vec<String>>,
}

/// The alternatives of one type of value.
type Cases = Vec<Map<String, Value>>;

impl<'d> Plain<'d> {
    /// For schemas that refer to these.
    pub fn new(definitions: &'d Map<String, Value>) -> Self {
        Self { definitions, open: RefCell::default() }
    }

    /// Rewrites all alternatives in a schema, and takes out `null`, which TOML does not have.
    pub fn rewrite(&self, schema: &mut Value) {
        let before = self.open.borrow().len();
        if let Value::Object(own) = schema {
            without_null(own);
            if let Some(rewritten) = self.rewritten(own) {
                *own = rewritten;
            }
        }
        match schema {
            Value::Object(own) => own.values_mut().for_each(|inner| self.rewrite(inner)),
            Value::Array(all) => all.iter_mut().for_each(|inner| self.rewrite(inner)),
            _ => {}
        }
        self.open.borrow_mut().truncate(before);
    }

    /// The schema without alternatives; `None` where it has none or where they cannot be told apart.
    fn rewritten(&self, own: &Map<String, Value>) -> Option<Map<String, Value>> {
        let mut rest = own.clone();
        let cases = take_cases(&mut rest)?;
        let before = self.open.borrow().len();
        let done = self.merged(&cases, rest);
        if done.is_none() {
            self.open.borrow_mut().truncate(before);
        }
        done
    }

    fn merged(&self, cases: &[Value], mut whole: Map<String, Value>) -> Option<Map<String, Value>> {
        let mut flat = Vec::new();
        for case in cases {
            self.flatten(case, &mut flat, DEEPEST)?;
        }
        let mut types: Vec<(String, Cases)> = Vec::new();
        for case in flat {
            let kind = type_of(&case)?;
            match types.iter_mut().find(|(other, _)| *other == kind) {
                Some((_, cases)) => cases.push(case),
                None => types.push((kind, vec![case])),
            }
        }
        let names: Vec<&str> = types.iter().map(|(kind, _)| kind.as_str()).collect();
        let single = names.len() == 1;
        whole.insert("type".to_owned(), if single { json!(names[0]) } else { json!(names) });
        for (kind, cases) in &types {
            match (kind.as_str(), cases.as_slice()) {
                ("string", _) if cases.iter().any(is_word) => words(&mut whole, cases, single)?,
                (_, [case]) => add(&mut whole, case)?,
                ("object", _) => add(&mut whole, &tagged(cases)?)?,
                _ if single => return None,
                _ => guard(&mut whole, kind, json!({ "anyOf": cases })),
            }
        }
        Some(whole)
    }

    /// The alternatives behind references, and those of alternatives.
    fn flatten(&self, case: &Value, flat: &mut Cases, left: usize) -> Option<()> {
        let left = left.checked_sub(1)?;
        let mut own = case.as_object()?.clone();
        if let Some(name) = own.get("$ref").and_then(Value::as_str).and_then(name_of) {
            if self.open.borrow().iter().any(|open| open == name) {
                return None;
            }
            let target = self.definitions.get(name)?;
            self.open.borrow_mut().push(name.to_owned());
            return self.flatten(target, flat, left);
        }
        without_null(&mut own);
        match take_cases(&mut own) {
            Some(cases) if own.keys().all(|key| ANNOTATIONS.contains(&key.as_str())) => {
                cases.iter().try_for_each(|case| self.flatten(case, flat, left))
            }
            Some(_) => None,
            None => {
                flat.push(own);
                Some(())
            }
        }
    }
}

/// Takes out the alternatives of a schema, unless they are there for editors only: then the last is always right.
fn take_cases(own: &mut Map<String, Value>) -> Option<Vec<Value>> {
    let key = ["oneOf", "anyOf"].into_iter().find(|key| own.contains_key(*key))?;
    let cases = own.get(key)?.as_array()?;
    if cases.iter().any(|case| !case.is_object()) {
        return None;
    }
    own.remove(key)?.as_array().cloned()
}

/// Takes out `null`: an option that is left out.
fn without_null(own: &mut Map<String, Value>) {
    if let Some(Value::Array(types)) = own.get_mut("type") {
        types.retain(|kind| kind != "null");
        if let [only] = types.as_slice() {
            let only = only.clone();
            own.insert("type".to_owned(), only);
        }
    }
    own.retain(|key, value| key != "default" || !value.is_null());
    let Some(Value::Array(cases)) = own.get_mut("anyOf") else { return };
    cases.retain(|case| case.get("type").is_none_or(|kind| kind != "null"));
    if let [Value::Object(only)] = cases.as_slice() {
        let only = only.clone();
        own.remove("anyOf");
        only.into_iter().for_each(|(key, value)| {
            own.entry(key).or_insert(value);
        });
    }
}

/// The type of the values of an alternative, where it is one.
fn type_of(case: &Map<String, Value>) -> Option<String> {
    match case.get("type") {
        Some(kind) => kind.as_str().map(str::to_owned),
        None => case.get("const").filter(|value| value.is_string()).map(|_| "string".to_owned()),
    }
}

fn is_word(case: &Map<String, Value>) -> bool {
    case.contains_key("const") || case.contains_key("enum")
}

/// Adds words to choose from. What each means stands beside them for editors.
fn words(whole: &mut Map<String, Value>, cases: &Cases, single: bool) -> Option<()> {
    let mut all = Vec::new();
    for case in cases {
        match (case.get("const"), case.get("enum")) {
            (Some(word), None) => all.push(word.clone()),
            (None, Some(Value::Array(words))) => all.extend(words.iter().cloned()),
            _ => return None,
        }
    }
    if cases.iter().any(|case| case.contains_key("description")) {
        if whole.contains_key("anyOf") {
            return None;
        }
        let mut shown: Vec<Value> = cases
            .iter()
            .map(|case| {
                let kept = |key: &String| key != "type";
                let case = case.iter().filter(|(key, _)| kept(key));
                Value::Object(case.map(|(key, value)| (key.clone(), value.clone())).collect())
            })
            .collect();
        shown.push(json!(true));
        whole.insert("anyOf".to_owned(), Value::Array(shown));
    }
    if single {
        whole.insert("enum".to_owned(), Value::Array(all));
    } else {
        guard(whole, "string", json!({ "enum": all }));
    }
    Some(())
}

/// Adds what holds for values of one type only.
fn guard(whole: &mut Map<String, Value>, kind: &str, then: Value) {
    let case = json!({ "if": { "type": kind }, "then": then });
    let all = whole.entry("allOf").or_insert_with(|| json!([]));
    all.as_array_mut().into_iter().for_each(|all| all.push(case.clone()));
}

/// Adds the keywords of an alternative, which say something of its type only.
fn add(whole: &mut Map<String, Value>, case: &Map<String, Value>) -> Option<()> {
    for (key, value) in case.iter().filter(|(key, _)| *key != "type") {
        match (whole.get_mut(key), value) {
            (None, _) => {
                whole.insert(key.clone(), value.clone());
            }
            (Some(Value::Array(all)), Value::Array(more)) if key == "allOf" => {
                all.extend(more.iter().cloned());
            }
            (Some(_), _) if ANNOTATIONS.contains(&key.as_str()) => {}
            (Some(other), _) if other == value => {}
            _ => return None,
        }
    }
    Some(())
}

/// Tables with one key each as a table with one of the keys.
fn tagged(cases: &Cases) -> Option<Map<String, Value>> {
    let mut properties = Map::new();
    for case in cases {
        let own = case.get("properties")?.as_object()?;
        let (key, value) = own.iter().next()?;
        let alone = own.len() == 1 && case.get("required") == Some(&json!([key]));
        if !alone || case.get("additionalProperties") != Some(&json!(false)) {
            return None;
        }
        let mut value = value.clone();
        if let (Some(text), Value::Object(own)) = (case.get("description"), &mut value) {
            own.entry("description").or_insert_with(|| text.clone());
        }
        if properties.insert(key.clone(), value).is_some() {
            return None;
        }
    }
    let whole = json!({
        "properties": properties,
        "additionalProperties": false,
        "minProperties": 1,
        "maxProperties": 1,
    });
    whole.as_object().cloned()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    fn rewritten(schema: Value, definitions: Value) -> Value {
        let definitions = definitions.as_object().unwrap().clone();
        let mut schema = schema;
        Plain::new(&definitions).rewrite(&mut schema);
        schema
    }

    #[test]
    fn words_and_tables_of_one_key_are_one_schema() {
        let table = |key: &str| {
            json!({ "type": "object", "properties": { key: { "type": "number" } }, "required": [key],
                    "additionalProperties": false })
        };
        let word = json!({ "type": "string", "const": "all", "description": "All of them." });
        let found =
            rewritten(json!({ "oneOf": [word, table("share"), table("count")] }), json!({}));
        let number = json!({ "type": "number" });
        let expected = json!({
            "type": ["string", "object"],
            "anyOf": [{ "const": "all", "description": "All of them." }, true],
            "allOf": [{ "if": { "type": "string" }, "then": { "enum": ["all"] } }],
            "properties": { "share": number, "count": number },
            "additionalProperties": false,
            "minProperties": 1,
            "maxProperties": 1,
        });
        assert_eq!(found, expected);
    }

    #[test]
    fn alternatives_of_different_types_are_one_schema() {
        let table =
            json!({ "type": "object", "properties": { "value": { "type": ["number", "null"] } } });
        let either =
            json!({ "anyOf": [{ "type": "number", "minimum": 0 }, { "$ref": "#/$defs/Table" }] });
        let optional =
            json!({ "anyOf": [{ "$ref": "#/$defs/Either" }, { "type": "null" }], "default": null });
        let definitions = json!({ "Table": table, "Either": either });
        let expected = json!({
            "type": ["number", "object"], "minimum": 0, "properties": { "value": { "type": "number" } },
        });
        assert_eq!(rewritten(either, definitions.clone()), expected);
        assert_eq!(rewritten(optional, definitions), json!({ "$ref": "#/$defs/Either" }));
    }

    #[test]
    fn alternatives_that_cannot_be_told_apart_stay() {
        let same = json!({ "anyOf": [{ "type": "array", "maxItems": 2 }, { "type": "array", "minItems": 4 }] });
        assert_eq!(rewritten(same.clone(), json!({})), same);
        // A definition that leads to itself.
        let circle = json!({ "anyOf": [{ "$ref": "#/$defs/Circle" }, { "type": "string" }] });
        assert_eq!(rewritten(circle.clone(), json!({ "Circle": circle.clone() })), circle);
    }
}
