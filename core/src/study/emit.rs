//! Trees as readable TOML 1.0: sections with headers, small tables in braces.

use std::fmt::Write as _;

use serde::Serialize;
use serde_json::{Map, Value};

/// Lines are kept below this many characters where braces can be avoided.
const WIDTH: usize = 90;

/// What TOML cannot say.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{path}` cannot be written as TOML: {reason}")]
pub struct Unwritable {
    /// Dotted path of the value.
    pub path: String,
    /// Why it cannot be written.
    pub reason: String,
}

/// Writes a tree, whose root must be a table; keys without a value are left out.
pub fn to_toml<T: Serialize>(tree: &T) -> Result<String, Unwritable> {
    let unwritable = |reason: String| Unwritable { path: String::new(), reason };
    match serde_json::to_value(tree).map_err(|error| unwritable(error.to_string()))? {
        Value::Object(root) => {
            let mut writer = Writer { text: String::new() };
            writer.table(&mut Vec::new(), &root)?;
            Ok(writer.text)
        }
        other => Err(unwritable(format!("the root is no table but {other}"))),
    }
}

/// A number as TOML writes it: the shortest text that reads back to the same bits.
pub fn float(x: f64) -> String {
    if x.is_finite() {
        format!("{x:?}")
    } else if x.is_nan() {
        "nan".to_owned()
    } else if x > 0.0 {
        "inf".to_owned()
    } else {
        "-inf".to_owned()
    }
}

/// A string as TOML writes it.
pub fn string(text: &str) -> String {
    let mut quoted = String::with_capacity(text.len() + 2);
    quoted.push('"');
    for c in text.chars() {
        match c {
            '"' => quoted.push_str("\\\""),
            '\\' => quoted.push_str("\\\\"),
            '\n' => quoted.push_str("\\n"),
            '\t' => quoted.push_str("\\t"),
            '\r' => quoted.push_str("\\r"),
            c if c.is_control() => {
                let _ = write!(quoted, "\\u{:04X}", u32::from(c));
            }
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

/// A key as TOML writes it: bare where it can be.
pub fn key(name: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(bare) { name.to_owned() } else { string(name) }
}

/// A value on one line, tables in braces.
pub fn inline_value(value: &Value) -> Result<String, Unwritable> {
    inline(&[], value)
}

struct Writer {
    text: String,
}

impl Writer {
    /// The entries of a table: values first, then the tables that have headers.
    fn table(
        &mut self,
        path: &mut Vec<String>,
        table: &Map<String, Value>,
    ) -> Result<(), Unwritable> {
        let mut sections = Vec::new();
        for (name, value) in table.iter().filter(|(_, value)| !value.is_null()) {
            path.push(key(name));
            if wants_header(path, value)? {
                sections.push((name, value));
            } else {
                let written = inline(path, value)?;
                let line = format!("{} = {written}", key(name));
                if line.chars().count() > WIDTH && value.is_array() {
                    self.long_array(path, name, value)?;
                } else {
                    self.line(&line);
                }
            }
            path.pop();
        }
        for (name, value) in sections {
            path.push(key(name));
            match value {
                Value::Array(tables) => {
                    for table in tables.iter().filter_map(Value::as_object) {
                        self.header(&format!("[[{}]]", path.join(".")));
                        self.table(path, table)?;
                    }
                }
                Value::Object(table) => {
                    self.header(&format!("[{}]", path.join(".")));
                    self.table(path, table)?;
                }
                _ => {}
            }
            path.pop();
        }
        Ok(())
    }

    fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    fn header(&mut self, header: &str) {
        if !self.text.is_empty() {
            self.text.push('\n');
        }
        self.line(header);
    }

    /// An array with as many elements a line as fit.
    fn long_array(&mut self, path: &[String], name: &str, array: &Value) -> Result<(), Unwritable> {
        self.line(&format!("{} = [", key(name)));
        let mut line = String::new();
        for element in array.as_array().into_iter().flatten() {
            let written = inline(path, element)?;
            if !line.is_empty() && line.chars().count() + written.chars().count() + 6 > WIDTH {
                self.line(&format!("   {line}"));
                line.clear();
            }
            let _ = write!(line, " {written},");
        }
        self.line(&format!("   {line}"));
        self.line("]");
        Ok(())
    }
}

/// True for what is clearer under a header: sections, lists of named tables, all that is long.
fn wants_header(path: &[String], value: &Value) -> Result<bool, Unwritable> {
    let long = || -> Result<bool, Unwritable> {
        let name = path.last().map_or(0, |name| name.chars().count());
        Ok(name + 3 + inline(path, value)?.chars().count() > WIDTH)
    };
    match value {
        Value::Object(_) => Ok(path.len() == 1 || long()?),
        Value::Array(elements) => {
            let tables = !elements.is_empty() && elements.iter().all(Value::is_object);
            Ok(tables && (path.len() == 1 || long()?))
        }
        _ => Ok(false),
    }
}

/// A value on one line.
fn inline(path: &[String], value: &Value) -> Result<String, Unwritable> {
    let unwritable = |reason: &str| Unwritable { path: path.join("."), reason: reason.to_owned() };
    Ok(match value {
        Value::Null => return Err(unwritable("an array has an element without a value")),
        Value::Bool(b) => b.to_string(),
        Value::Number(number) => match (number.as_i64(), number.as_u64(), number.as_f64()) {
            (Some(i), ..) => i.to_string(),
            (None, Some(_), _) => return Err(unwritable("the whole number is too large")),
            (None, None, x) => float(x.unwrap_or(f64::NAN)),
        },
        Value::String(text) => string(text),
        Value::Array(elements) => {
            let written: Result<Vec<String>, _> =
                elements.iter().map(|element| inline(path, element)).collect();
            format!("[{}]", written?.join(", "))
        }
        Value::Object(table) => {
            let entries = table.iter().filter(|(_, value)| !value.is_null());
            let written: Result<Vec<String>, _> = entries
                .map(|(name, value)| Ok(format!("{} = {}", key(name), inline(path, value)?)))
                .collect();
            match written?.join(", ") {
                entries if entries.is_empty() => "{}".to_owned(),
                entries => format!("{{ {entries} }}"),
            }
        }
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use serde_json::json;

    use super::*;

    fn tree() -> Value {
        let long: Vec<f64> = (1..40).map(|i| 1.0 / f64::from(i)).collect();
        json!({
            "study": { "title": "a \"quoted\" \\ line\nand µ\u{1}", "seed": 7, "note": null },
            "parameter": [
                { "name": "density", "prior": { "uniform": [1.0, 1.5e7] }, "reference": 1e-6 },
                { "name": "speed", "prior": { "normal": { "mean": 0.0, "sd": 1e300 } } },
            ],
            "surrogate": { "use": "chaos", "degree": { "max": 20 }, "points": long, "on": true },
            "odd key": { "": [], "empty": {}, "nested": [[1, 2], ["a"]] },
            "wide": { "table": {
                "first": "a text that is long enough to make the line far too wide for a reader",
                "second": "another one that does the same", "third": { "deep": 1 },
            } },
        })
    }

    /// The reader is the `toml` crate's own; nested values come back bit for bit.
    #[test]
    fn what_is_written_reads_back() {
        let text = to_toml(&tree()).unwrap();
        let read: Value = serde_json::to_value(text.parse::<toml::Table>().unwrap()).unwrap();
        let mut expected = tree();
        expected["study"].as_object_mut().unwrap().remove("note");
        assert_eq!(read, expected, "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    }

    #[test]
    fn small_tables_stand_in_braces() {
        let text = to_toml(&tree()).unwrap();
        let start = "[study]\ntitle = \"a \\\"quoted\\\" \\\\ line\\nand µ\\u0001\"\nseed = 7\n\n\
                     [[parameter]]\nname = \"density\"\nprior = { uniform = [1.0, 15000000.0] }\n\
                     reference = 1e-6\n\n[[parameter]]\nname = \"speed\"\n\
                     prior = { normal = { mean = 0.0, sd = 1e300 } }\n";
        assert!(text.starts_with(start), "{text}");
        assert!(text.contains("\n[wide.table]\nfirst = "), "{text}");
        assert!(text.contains("\n[\"odd key\"]\n\"\" = []\nempty = {}\n"), "{text}");
    }

    #[test]
    fn floats_are_shortest_and_exact() {
        for (x, text) in [(1e-6, "1e-6"), (0.1, "0.1"), (1.0, "1.0"), (-2.5e-20, "-2.5e-20")] {
            assert_eq!(float(x), text);
        }
        for bits in (0..2000u64).map(|i| i.wrapping_mul(0x9E37_79B9_7F4A_7C15)) {
            let x = f64::from_bits(bits);
            if x.is_finite() {
                let table: toml::Table = format!("x = {}", float(x)).parse().unwrap();
                assert_eq!(table["x"].as_float().unwrap().to_bits(), bits);
            }
        }
    }

    #[test]
    fn what_toml_cannot_say_is_refused() {
        let error = to_toml(&json!({ "a": { "b": [null] } })).unwrap_err();
        assert_eq!(error.path, "a.b");
        assert!(to_toml(&json!({ "a": u64::MAX })).is_err());
        assert!(to_toml(&json!([1])).is_err());
    }
}
