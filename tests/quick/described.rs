//! Summaries of runs, each checked against the schema of `summary.json`.

use std::sync::LazyLock;

use lacuna_engine::report::findings::Findings;
use lacuna_engine::report::{schema, summary};
use serde_json::Value;

/// The summary of findings, every key of which is in the schema.
pub fn summary_of(findings: &Findings) -> Value {
    described(serde_json::to_value(summary(findings)).unwrap())
}

/// A summary, of which the schema must describe every key and every value.
pub fn described(summary: Value) -> Value {
    static SCHEMA: LazyLock<Value> = LazyLock::new(schema);
    let faults = faults(&SCHEMA, &summary);
    assert!(faults.is_empty(), "not as the schema of the summary says:\n{}", faults.join("\n"));
    summary
}

/// The keywords that the check knows, or that say nothing about a value.
const KNOWN: [&str; 18] = [
    "$defs",
    "$ref",
    "$schema",
    "additionalProperties",
    "anyOf",
    "const",
    "description",
    "enum",
    "items",
    "maxItems",
    "minItems",
    "minimum",
    "oneOf",
    "prefixItems",
    "properties",
    "propertyNames",
    "required",
    "title",
];

/// The parts of a value that a schema does not describe, each with its path; none where it fits.
fn faults(root: &Value, value: &Value) -> Vec<String> {
    let mut faults = Vec::new();
    Check { root, faults: &mut faults }.value(root, value, "");
    faults
}

struct Check<'a> {
    root: &'a Value,
    faults: &'a mut Vec<String>,
}

impl Check<'_> {
    fn say(&mut self, path: &str, fault: &str) {
        self.faults.push(format!("{path}: {fault}"));
    }

    fn value(&mut self, schema: &Value, value: &Value, path: &str) {
        for (keyword, rule) in schema.as_object().unwrap() {
            assert!(
                keyword == "type" || KNOWN.contains(&&**keyword),
                "the check knows no {keyword}"
            );
            match &**keyword {
                "$ref" => {
                    let name = rule.as_str().unwrap().strip_prefix("#/$defs/").unwrap();
                    self.value(&self.root["$defs"][name], value, path);
                }
                "type" => {
                    let kinds = rule.as_array().cloned().unwrap_or_else(|| vec![rule.clone()]);
                    if !kinds.iter().any(|kind| is(kind.as_str().unwrap(), value)) {
                        self.say(path, &format!("{value} is not of type {rule}"));
                    }
                }
                "const" if rule != value => self.say(path, &format!("{value} is not {rule}")),
                "enum" if !rule.as_array().unwrap().contains(value) => {
                    self.say(path, &format!("{value} is none of {rule}"));
                }
                "minimum" if value.is_number() && value.as_f64() < rule.as_f64() => {
                    self.say(path, &format!("{value} is below {rule}"));
                }
                "anyOf" | "oneOf" => self.cases(rule.as_array().unwrap(), value, path),
                _ => {}
            }
        }
        if let Some(object) = value.as_object() {
            let required = schema["required"].as_array().into_iter().flatten();
            for name in
                required.filter_map(Value::as_str).filter(|name| !object.contains_key(*name))
            {
                self.say(path, &format!("`{name}` is missing"));
            }
            for (name, value) in object {
                let of_name = schema["properties"].get(name).or(schema.get("additionalProperties"));
                match of_name {
                    Some(Value::Bool(false)) => {
                        self.say(path, &format!("`{name}` is not in the schema"));
                    }
                    Some(schema) => self.value(schema, value, &format!("{path}/{name}")),
                    None => {}
                }
            }
        }
        for (i, item) in value.as_array().into_iter().flatten().enumerate() {
            let of_item = schema["prefixItems"].get(i).or(schema.get("items"));
            if let Some(schema) = of_item {
                self.value(schema, item, &format!("{path}/{i}"));
            }
        }
        if let Some(items) = value.as_array() {
            let count = |key: &str| schema[key].as_u64().map(|count| count as usize);
            if count("minItems").is_some_and(|least| items.len() < least)
                || count("maxItems").is_some_and(|most| items.len() > most)
            {
                self.say(path, &format!("{} items", items.len()));
            }
        }
    }

    /// One of several schemas has to describe the value; otherwise the faults of the nearest are told.
    fn cases(&mut self, cases: &[Value], value: &Value, path: &str) {
        let of_case = |case: &Value| {
            let mut faults = Vec::new();
            Check { root: self.root, faults: &mut faults }.value(case, value, path);
            faults
        };
        let nearest = cases.iter().map(of_case).min_by_key(Vec::len).unwrap_or_default();
        self.faults.extend(nearest);
    }
}

fn is(kind: &str, value: &Value) -> bool {
    match kind {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_u64() || value.is_i64(),
        "number" => value.is_number(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        other => panic!("no type: {other}"),
    }
}

#[test]
fn a_key_that_is_not_in_the_schema_is_found() {
    let schema = serde_json::json!({
        "properties": { "p": { "type": ["number", "null"] }, "parts": { "items": { "$ref": "#/$defs/Part" } } },
        "required": ["p"],
        "additionalProperties": false,
        "$defs": { "Part": { "oneOf": [
            { "properties": { "kind": { "const": "one" } }, "required": ["kind"], "additionalProperties": false },
            { "properties": { "kind": { "const": "two" }, "of": { "type": "string" } },
              "required": ["kind", "of"], "additionalProperties": false },
        ] } },
    });
    let of = |value: Value| faults(&schema, &value);
    let part = |part: Value| of(serde_json::json!({ "p": null, "parts": [part] }));
    assert!(part(serde_json::json!({ "kind": "two", "of": "text" })).is_empty());
    assert_eq!(of(serde_json::json!({ "p": 0.5, "q": 1 })), [": `q` is not in the schema"]);
    assert_eq!(of(serde_json::json!({})), [": `p` is missing"]);
    assert_eq!(
        of(serde_json::json!({ "p": "0.5" })),
        ["/p: \"0.5\" is not of type [\"number\",\"null\"]"]
    );
    let unknown = part(serde_json::json!({ "kind": "two", "of": "text", "by": 2 }));
    assert_eq!(unknown, ["/parts/0: `by` is not in the schema"]);
}
