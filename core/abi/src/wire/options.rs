//! Options: TOML as JSON, to the bit. A number that is not finite is written `{"float": "inf"}`.

use lacuna::text::{Key, Node, Place, Value};
use serde_json::{Map, Value as Json, json};
use toml::{Table, Value as Toml};

/// A number as JSON.
fn json_of_float(x: f64) -> Json {
    let text = if x.is_nan() {
        "nan"
    } else if x > 0.0 {
        "inf"
    } else {
        "-inf"
    };
    if x.is_finite() { json!(x) } else { json!({ "float": text }) }
}

/// The number that is not finite which an object stands for.
fn float_of_json(object: &Map<String, Json>) -> Option<f64> {
    let text = object.get("float").filter(|_| object.len() == 1)?.as_str()?;
    ["inf", "-inf", "nan"].contains(&text).then(|| text.parse().ok())?
}

/// Options as they are written.
pub fn json_of_node(node: &Node) -> Json {
    match &node.value {
        Value::String(text) | Value::Datetime(text) => json!(text),
        Value::Integer(i) => json!(i),
        Value::Float(x) => json_of_float(*x),
        Value::Boolean(b) => json!(b),
        Value::Array(elements) => elements.iter().map(json_of_node).collect(),
        Value::Table(entries) => {
            entries.iter().map(|(key, node)| (key.name.clone(), json_of_node(node))).collect()
        }
    }
}

/// Options as if they were written at `place`; a `null` is not there.
pub fn node_of_json(json: &Json, place: &Place) -> Option<Node> {
    let value = match json {
        Json::Null => return None,
        Json::Bool(b) => Value::Boolean(*b),
        Json::Number(n) => match n.as_i64() {
            Some(i) => Value::Integer(i),
            None => Value::Float(n.as_f64()?),
        },
        Json::String(text) => Value::String(text.clone()),
        Json::Array(elements) => {
            Value::Array(elements.iter().filter_map(|e| node_of_json(e, place)).collect())
        }
        Json::Object(entries) => float_of_json(entries).map_or_else(
            || {
                let entry = |(name, json): (&String, &Json)| {
                    let key = Key { name: name.clone(), place: place.clone() };
                    Some((key, node_of_json(json, place)?))
                };
                Value::Table(entries.iter().filter_map(entry).collect())
            },
            Value::Float,
        ),
    };
    Some(Node { value, place: place.clone() })
}

/// Options with their defaults.
pub fn json_of_table(table: &Table) -> Json {
    Json::Object(table.iter().map(|(key, value)| (key.clone(), json_of_toml(value))).collect())
}

fn json_of_toml(value: &Toml) -> Json {
    match value {
        Toml::String(text) => json!(text),
        Toml::Integer(i) => json!(i),
        Toml::Float(x) => json_of_float(*x),
        Toml::Boolean(b) => json!(b),
        Toml::Datetime(date) => json!(date.to_string()),
        Toml::Array(elements) => elements.iter().map(json_of_toml).collect(),
        Toml::Table(table) => json_of_table(table),
    }
}

/// Options with their defaults, as a study writes them; a `null` is not there.
pub fn table_of_json(object: &Map<String, Json>) -> Table {
    let entry = |(key, json): (&String, &Json)| Some((key.clone(), toml_of_json(json)?));
    object.iter().filter_map(entry).collect()
}

fn toml_of_json(json: &Json) -> Option<Toml> {
    Some(match json {
        Json::Null => return None,
        Json::Bool(b) => Toml::Boolean(*b),
        Json::Number(n) => match n.as_i64() {
            Some(i) => Toml::Integer(i),
            None => Toml::Float(n.as_f64()?),
        },
        Json::String(text) => Toml::String(text.clone()),
        Json::Array(elements) => Toml::Array(elements.iter().filter_map(toml_of_json).collect()),
        Json::Object(entries) => match float_of_json(entries) {
            Some(x) => Toml::Float(x),
            None => Toml::Table(table_of_json(entries)),
        },
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use lacuna::text::read::read;
    use lacuna::text::{Problems, Sources};

    const TEXT: &str = "whole = 3\nnumber = 3.0\nsmall = 1e-310\nword = \"a \\\"b\\\"\"\nyes = true\n\
                        open = [-inf, inf]\nlaw = { normal = [0.1, 2.0] }\nempty = {}\n";

    #[test]
    fn options_come_back_to_the_bit() {
        let table: Table = TEXT.parse().unwrap();
        let json: Json = serde_json::from_str(&json_of_table(&table).to_string()).unwrap();
        assert_eq!(table_of_json(json.as_object().unwrap()), table);

        let (mut sources, mut problems) = (Sources::default(), Problems::new());
        let source = sources.add_argument("options", TEXT.to_owned());
        let node = read(source, &sources, &mut problems).unwrap();
        assert_eq!(json_of_node(&node), json);
        let again = node_of_json(&json, &Place::whole(source)).unwrap();
        assert_eq!(json_of_node(&again), json);
        assert_eq!(again.get("number").unwrap().value, Value::Float(3.0));
        assert_eq!(again.get("whole").unwrap().value, Value::Integer(3));
    }
}
