//! Writing of trees as readable TOML 1.0: sections with headers, small tables in braces.

use std::fmt::Write as _;

use serde::Serialize;
use toml::{Table, Value};

/// Target width of a line, in characters, where braces can be avoided.
const WIDTH: usize = 90;

/// Error: a value that TOML cannot represent, such as an array with a missing element.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cannot be written as TOML: {0}")]
pub struct Unwritable(String);

/// Converts a tree to a table; fields that are `None` are left out.
pub fn to_table<T: Serialize>(tree: &T) -> Result<Table, Unwritable> {
    Table::try_from(tree).map_err(|error| Unwritable(error.to_string().trim_end().to_owned()))
}

/// Writes a tree, whose root must be a table, as TOML; fields that are `None` are left out.
pub fn to_toml<T: Serialize>(tree: &T) -> Result<String, Unwritable> {
    let mut writer = Writer { text: String::new() };
    writer.table(&mut Vec::new(), &to_table(tree)?);
    Ok(writer.text)
}

/// Writes a value on one line, tables in braces.
pub fn to_line<T: Serialize>(value: &T) -> Result<String, Unwritable> {
    let value = Value::try_from(value);
    value.map(|value| inline(&value)).map_err(|error| Unwritable(error.to_string()))
}

/// A number in TOML: the shortest text that reads back to the same bits.
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

/// A string in TOML.
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

/// A key in TOML: bare if possible.
pub fn key(name: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(bare) { name.to_owned() } else { string(name) }
}

struct Writer {
    text: String,
}

impl Writer {
    /// Writes the entries of a table: values first, then the tables that have headers.
    fn table(&mut self, path: &mut Vec<String>, table: &Table) {
        let depth = path.len();
        let (sections, values): (Vec<_>, Vec<_>) =
            table.iter().partition(|(name, value)| wants_header(depth, name, value));
        for (name, value) in values {
            let line = format!("{} = {}", key(name), inline(value));
            match value {
                Value::Array(elements) if line.chars().count() > WIDTH => {
                    self.long_array(name, elements);
                }
                _ => self.line(&line),
            }
        }
        for (name, value) in sections {
            path.push(key(name));
            match value {
                Value::Array(tables) => {
                    for table in tables.iter().filter_map(Value::as_table) {
                        self.header(&format!("[[{}]]", path.join(".")));
                        self.table(path, table);
                    }
                }
                Value::Table(table) => {
                    self.header(&format!("[{}]", path.join(".")));
                    self.table(path, table);
                }
                _ => {}
            }
            path.pop();
        }
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

    /// Writes an array with as many elements per line as fit.
    fn long_array(&mut self, name: &str, elements: &[Value]) {
        self.line(&format!("{} = [", key(name)));
        let mut line = String::new();
        for element in elements {
            let written = inline(element);
            if !line.is_empty() && line.chars().count() + written.chars().count() + 6 > WIDTH {
                self.line(&format!("   {line}"));
                line.clear();
            }
            let _ = write!(line, " {written},");
        }
        self.line(&format!("   {line}"));
        self.line("]");
    }
}

/// Returns true for values that are clearer under a header: sections, lists of named tables, anything long.
fn wants_header(depth: usize, name: &str, value: &Value) -> bool {
    let table = match value {
        Value::Table(_) => true,
        Value::Array(elements) => !elements.is_empty() && elements.iter().all(Value::is_table),
        _ => false,
    };
    table && (depth == 0 || name.chars().count() + 3 + inline(value).chars().count() > WIDTH)
}

fn inline(value: &Value) -> String {
    match value {
        Value::Boolean(b) => b.to_string(),
        Value::Integer(i) => i.to_string(),
        Value::Float(x) => float(*x),
        Value::String(text) => string(text),
        Value::Datetime(date) => date.to_string(),
        Value::Array(elements) => {
            let written: Vec<String> = elements.iter().map(inline).collect();
            format!("[{}]", written.join(", "))
        }
        Value::Table(table) if table.is_empty() => "{}".to_owned(),
        Value::Table(table) => {
            let entry =
                |(name, value): (&String, &Value)| format!("{} = {}", key(name), inline(value));
            let written: Vec<String> = table.iter().map(entry).collect();
            format!("{{ {} }}", written.join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use serde_json::{Value as Json, json};

    use super::*;

    fn tree() -> Json {
        let long: Vec<f64> = (1..40).map(|i| 1.0 / f64::from(i)).collect();
        json!({
            "study": { "title": "a \"quoted\" \\ line\nand µ\u{1}", "seed": 7 },
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

    /// The text is read back by the `toml` crate; nested values come back bit for bit.
    #[test]
    fn what_is_written_reads_back() {
        let text = to_toml(&tree()).unwrap();
        let read = serde_json::to_value(text.parse::<Table>().unwrap()).unwrap();
        assert_eq!(read, tree(), "{text}");
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
    fn infinities_are_kept_and_what_is_absent_is_left_out() {
        #[derive(Serialize)]
        struct Law {
            bounds: [f64; 2],
            note: Option<u8>,
        }
        let law = Law { bounds: [f64::NEG_INFINITY, f64::INFINITY], note: None };
        assert_eq!(to_toml(&law).unwrap(), "bounds = [-inf, inf]\n");
        assert_eq!(to_line(&law).unwrap(), "{ bounds = [-inf, inf] }");
    }

    #[test]
    fn what_toml_cannot_say_is_refused() {
        assert!(to_toml(&json!({ "a": { "b": [null] } })).is_err());
        assert!(to_toml(&json!({ "a": u64::MAX })).is_err());
        assert!(to_toml(&json!([1])).is_err());
    }
}
