//! Descriptions of the values that a schema allows.

use lacuna_base::text::emit;
use lacuna_base::text::nearest::one_of;
use schemars::SchemaGenerator;
use serde_json::{Map, Value};

use super::{Choice, follow, text};

/// Schema of an optional value without its alternative `null`.
pub(super) fn without_null(
    schema: &Map<String, Value>,
    generator: &SchemaGenerator,
) -> Map<String, Value> {
    let mut schema = schema.clone();
    if let Some(Value::Array(types)) = schema.get_mut("type") {
        types.retain(|kind| kind != "null");
        if let [only] = types.as_slice() {
            let only = only.clone();
            schema.insert("type".to_owned(), only);
        }
    }
    let cases = objects(&schema, "anyOf");
    let some: Vec<_> = cases.iter().filter(|case| text(case, "type") != "null").collect();
    if let ([only], 2) = (some.as_slice(), cases.len()) {
        let mut inner = follow(only, generator);
        schema.remove("anyOf");
        // The documentation of the option takes precedence over that of its type.
        inner.extend(schema);
        return inner;
    }
    schema
}

fn objects(schema: &Map<String, Value>, key: &str) -> Vec<Map<String, Value>> {
    let list = schema.get(key).and_then(Value::as_array);
    list.into_iter().flatten().filter_map(Value::as_object).cloned().collect()
}

/// Alternatives of an enum, with references resolved.
fn alternatives(
    schema: &Map<String, Value>,
    generator: &SchemaGenerator,
) -> Vec<Map<String, Value>> {
    let mut cases = objects(schema, "oneOf");
    cases.extend(objects(schema, "anyOf"));
    cases.iter().map(|case| follow(case, generator)).collect()
}

/// The only key of a table that represents a variant, and the schema under it.
fn variant<'s>(
    case: &'s Map<String, Value>,
    generator: &SchemaGenerator,
) -> Option<(&'s str, Map<String, Value>)> {
    let properties = case.get("properties")?.as_object()?;
    let required = case.get("required")?.as_array()?;
    let (name, content) = properties.iter().next()?;
    let single = properties.len() == 1 && required.len() == 1;
    single.then(|| (name.as_str(), follow(content.as_object().unwrap_or(&Map::new()), generator)))
}

/// Variants that contain a table of options.
pub(super) fn variants_with_content(
    schema: &Map<String, Value>,
    generator: &SchemaGenerator,
) -> Vec<(String, Map<String, Value>)> {
    let cases = alternatives(schema, generator);
    let variants = cases.iter().filter_map(|case| variant(case, generator));
    variants
        .filter(|(_, content)| content.contains_key("properties"))
        .map(|(name, content)| (name.to_owned(), content))
        .collect()
}

/// Allowed values.
pub(super) fn choices(schema: &Map<String, Value>, generator: &SchemaGenerator) -> Vec<Choice> {
    let mut choices = names(schema, "");
    for case in alternatives(schema, generator) {
        let description = text(&case, "description").trim();
        if let Some(name) = case.get("const").and_then(Value::as_str) {
            let written = emit::string(name);
            choices.push(Choice { written, literal: true, text: description.to_owned() });
        } else if case.contains_key("enum") {
            choices.extend(names(&case, description));
        } else if let Some((name, content)) = variant(&case, generator) {
            let written = format!("{{ {} = {} }}", emit::key(name), shape(&content));
            choices.push(Choice { written, literal: true, text: description.to_owned() });
        } else {
            let written = kind(&case, generator);
            choices.push(Choice { written, literal: false, text: description.to_owned() });
        }
    }
    choices
}

/// Length from which on a list of allowed numbers is not shown.
const MANY: u64 = 16;

/// Depth to which nested lists are described, because a type may contain itself.
const DEEPEST: usize = 8;

/// Form of a value, with its numbers and strings left open.
fn shape(schema: &Map<String, Value>) -> String {
    let count = |key: &str| schema.get(key).and_then(Value::as_u64);
    match (text(schema, "type"), count("minItems"), count("maxItems")) {
        ("array", Some(low), Some(high)) if low == high && low <= MANY => {
            format!("[{}]", vec!["…"; low as usize].join(", "))
        }
        ("array", ..) => "[…]".to_owned(),
        ("object", ..) => {
            let keys = schema.get("properties").and_then(Value::as_object);
            let keys = keys.into_iter().flatten().map(|(key, _)| format!("{} = …", emit::key(key)));
            format!("{{ {} }}", keys.collect::<Vec<_>>().join(", "))
        }
        _ => "…".to_owned(),
    }
}

/// Names of an enum whose variants have no content.
fn names(schema: &Map<String, Value>, description: &str) -> Vec<Choice> {
    let names = schema.get("enum").and_then(Value::as_array).into_iter().flatten();
    let choice = |name: &Value| Choice {
        written: as_toml(name),
        literal: true,
        text: description.to_owned(),
    };
    names.map(choice).collect()
}

/// Description of a value.
pub(super) fn kind(schema: &Map<String, Value>, generator: &SchemaGenerator) -> String {
    kind_at(schema, generator, 0)
}

fn kind_at(schema: &Map<String, Value>, generator: &SchemaGenerator, depth: usize) -> String {
    if depth > DEEPEST {
        return "a value".to_owned();
    }
    let schema = without_null(&follow(schema, generator), generator);
    if schema.contains_key("oneOf") || schema.contains_key("anyOf") || schema.contains_key("enum") {
        return "a choice".to_owned();
    }
    if let Some(value) = schema.get("const") {
        return as_toml(value);
    }
    if let Some(types) = schema.get("type").and_then(Value::as_array) {
        return one_of(types.iter().filter_map(Value::as_str)).replace('`', "");
    }
    match text(&schema, "type") {
        "integer" => range("a whole number", &schema),
        "number" => range("a number", &schema),
        "string" => "a string".to_owned(),
        "boolean" => "`true` or `false`".to_owned(),
        "array" => array(&schema, generator, depth + 1),
        "object" => "a table".to_owned(),
        _ => "a value".to_owned(),
    }
}

/// A number with its bounds; the bounds of machine types are left out because they are of no use to a user.
fn range(what: &str, schema: &Map<String, Value>) -> String {
    let bound = |key: &str| {
        let bound = schema.get(key).and_then(Value::as_f64)?;
        (bound.abs() < 1e9).then(|| plain(bound))
    };
    match (bound("minimum"), bound("exclusiveMinimum"), bound("maximum"), bound("exclusiveMaximum"))
    {
        (Some(low), _, Some(high), _) => format!("{what} from {low} to {high}"),
        (_, Some(low), _, Some(high)) => format!("{what} above {low} and below {high}"),
        (Some(low), None, None, None) => format!("{what} of {low} or more"),
        (None, Some(low), None, None) => format!("{what} above {low}"),
        (None, None, Some(high), None) => format!("{what} of {high} or less"),
        (None, None, None, Some(high)) => format!("{what} below {high}"),
        _ => what.to_owned(),
    }
}

fn plain(x: f64) -> String {
    if x.fract() == 0.0 { format!("{x:.0}") } else { emit::float(x) }
}

fn array(schema: &Map<String, Value>, generator: &SchemaGenerator, depth: usize) -> String {
    let count = |key: &str| schema.get(key).and_then(Value::as_u64);
    let size = match (count("minItems"), count("maxItems")) {
        (Some(low), Some(high)) if low == high => format!(" of {low}"),
        _ => String::new(),
    };
    let items = schema.get("items").and_then(Value::as_object);
    match items.map(|items| kind_at(items, generator, depth)) {
        Some(items) => format!("an array{size}, each {items}"),
        None => format!("an array{size}"),
    }
}

/// A default as a study would write it.
pub(super) fn as_toml(value: &Value) -> String {
    emit::to_line(value).unwrap_or_else(|_| value.to_string())
}
