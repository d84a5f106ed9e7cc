//! TOML values of a study as written, each with its place in the text.

use serde::ser::{Serialize, SerializeMap, Serializer};

use super::emit::float;
use super::source::Place;

/// A value and its place in the text.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// The value.
    pub value: Value,
    /// Place of the value; for a table with a header, that of the header.
    pub place: Place,
}

/// Key of a table entry and its place in the text.
#[derive(Clone, Debug, PartialEq)]
pub struct Key {
    /// The key, unquoted.
    pub name: String,
    /// Place of the key.
    pub place: Place,
}

/// A TOML value.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A string.
    String(String),
    /// A whole number.
    Integer(i64),
    /// A number with a point or an exponent; may be `inf` or `nan`.
    Float(f64),
    /// `true` or `false`.
    Boolean(bool),
    /// A date, a time or both, as text.
    Datetime(String),
    /// An array.
    Array(Vec<Node>),
    /// A table, with its entries in the order of the text.
    Table(Vec<(Key, Node)>),
}

impl Node {
    /// An empty table at `place`.
    pub fn table(place: Place) -> Self {
        Self { value: Value::Table(Vec::new()), place }
    }

    /// A string at `place`.
    pub fn string(text: impl Into<String>, place: Place) -> Self {
        Self { value: Value::String(text.into()), place }
    }

    /// Entries of a table; empty for any other value.
    pub fn entries(&self) -> &[(Key, Node)] {
        match &self.value {
            Value::Table(entries) => entries,
            _ => &[],
        }
    }

    /// Elements of an array; empty for any other value.
    pub fn elements(&self) -> &[Node] {
        match &self.value {
            Value::Array(elements) => elements,
            _ => &[],
        }
    }

    /// Value of a key of this table.
    pub fn get(&self, key: &str) -> Option<&Node> {
        self.entries().iter().find(|(k, _)| k.name == key).map(|(_, node)| node)
    }

    /// Value of a key of this table, mutable.
    pub fn get_mut(&mut self, key: &str) -> Option<&mut Node> {
        match &mut self.value {
            Value::Table(entries) => {
                entries.iter_mut().find(|(k, _)| k.name == key).map(|(_, node)| node)
            }
            _ => None,
        }
    }

    /// Sets a key of this table, at its present position if it exists; no effect on other values.
    pub fn set(&mut self, key: Key, node: Node) {
        if let Value::Table(entries) = &mut self.value {
            match entries.iter_mut().find(|(k, _)| k.name == key.name) {
                Some(entry) => *entry = (key, node),
                None => entries.push((key, node)),
            }
        }
    }

    /// Takes a value out of this table and leaves an empty table under its key.
    pub fn take(&mut self, key: &str) -> Option<Node> {
        let node = self.get_mut(key)?;
        let empty = Node::table(node.place.clone());
        Some(std::mem::replace(node, empty))
    }

    /// Removes a key from this table.
    pub fn remove(&mut self, key: &str) -> Option<(Key, Node)> {
        match &mut self.value {
            Value::Table(entries) => {
                let at = entries.iter().position(|(k, _)| k.name == key)?;
                Some(entries.remove(at))
            }
            _ => None,
        }
    }

    /// Text of a string.
    pub fn as_str(&self) -> Option<&str> {
        match &self.value {
            Value::String(text) => Some(text),
            _ => None,
        }
    }

    /// Name of an array element: the string under its key `name`.
    pub fn name(&self) -> Option<&str> {
        self.get("name").and_then(Node::as_str)
    }

    /// One step of a path: a key of a table, or the name or index of an array element.
    pub fn step(&self, step: &str) -> Option<&Node> {
        match &self.value {
            Value::Table(_) => self.get(step),
            Value::Array(elements) => elements
                .iter()
                .find(|element| element.name() == Some(step))
                .or_else(|| elements.get(step.parse::<usize>().ok()?)),
            _ => None,
        }
    }

    /// Value at a dotted path, such as `degree.max`; the empty path is the node itself.
    pub fn find(&self, path: &str) -> Option<&Node> {
        steps(path).try_fold(self, Node::step)
    }

    /// Place of the value at a dotted path, or of its nearest existing parent.
    pub fn nearest_place(&self, path: &str) -> Place {
        let mut node = self;
        let mut place = &self.place;
        for step in steps(path) {
            let Some(next) = node.step(step) else { break };
            // For an inline table the key marks the place better than the braces.
            let key = node.entries().iter().find(|(key, _)| key.name == step);
            place = match (&next.value, key) {
                (Value::Table(_), Some((key, _))) => &key.place,
                _ => &next.place,
            };
            node = next;
        }
        place.clone()
    }

    /// Description of the value in a message, after "found".
    pub fn describe(&self) -> String {
        match &self.value {
            Value::String(text) => quoted(text),
            Value::Integer(i) => i.to_string(),
            Value::Float(x) => float(*x),
            Value::Boolean(b) => b.to_string(),
            Value::Datetime(text) => text.clone(),
            Value::Array(_) => "an array".into(),
            Value::Table(_) => "a table".into(),
        }
    }
}

fn steps(path: &str) -> impl Iterator<Item = &str> {
    path.split('.').filter(|step| !step.is_empty())
}

/// A string in quotes for a message, truncated if it is long.
pub fn quoted(text: &str) -> String {
    const LONGEST: usize = 40;
    if text.chars().count() <= LONGEST {
        return format!("{text:?}");
    }
    let start: String = text.chars().take(LONGEST).collect();
    format!("{:?}", start + "…")
}

impl Serialize for Node {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.value {
            Value::String(text) | Value::Datetime(text) => serializer.serialize_str(text),
            Value::Integer(i) => serializer.serialize_i64(*i),
            Value::Float(x) => serializer.serialize_f64(*x),
            Value::Boolean(b) => serializer.serialize_bool(*b),
            Value::Array(elements) => serializer.collect_seq(elements),
            Value::Table(entries) => {
                let mut map = serializer.serialize_map(Some(entries.len()))?;
                for (key, node) in entries {
                    map.serialize_entry(&key.name, node)?;
                }
                map.end()
            }
        }
    }
}
