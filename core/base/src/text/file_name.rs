//! Names that become names of files and folders.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserializer};
use serde::{Deserialize, Serialize};

use super::values::Unfit;

/// A valid name of a file or folder: not a path, not hidden.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(transparent)]
pub struct FileName(String);

impl FileName {
    /// Largest length in bytes: file systems allow 255, and suffixes are added.
    pub const MOST: usize = 200;

    /// Checks that a text is the name of a file or folder and not a path.
    ///
    /// # Errors
    /// What was expected and what was found.
    pub fn new(text: impl Into<String>) -> Result<Self, Unfit> {
        let text = text.into();
        let plain = |c: char| !c.is_control() && !r#"/\:*?"<>|"#.contains(c);
        let trimmed = !text.is_empty() && text.trim() == text;
        let hidden = text.starts_with(['.', '-', '~']) || text.ends_with('.');
        if trimmed && !hidden && text.len() <= Self::MOST && text.chars().all(plain) {
            return Ok(Self(text));
        }
        let expected = "a plain name for files: at most 200 bytes, none of `/ \\ : * ? \" < > |`, \
                        not beginning with `.`, `-` or `~`";
        Err(Unfit::new(expected, super::node::quoted(&text)))
    }

    /// The name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl From<FileName> for String {
    fn from(name: FileName) -> String {
        name.0
    }
}

impl<'de> Deserialize<'de> for FileName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::new(String::deserialize(deserializer)?).map_err(de::Error::custom)
    }
}

impl JsonSchema for FileName {
    fn schema_name() -> Cow<'static, str> {
        "FileName".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": "^[^./\\\\:*?\"<>|~-][^/\\\\:*?\"<>|]*$" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_no_names() {
        for plain in ["sns", "a b", "run+damping", "π 2", "x.y"] {
            assert!(FileName::new(plain).is_ok(), "{plain}");
        }
        let long = "x".repeat(201);
        for path in
            ["", ".", "..", "../x", "/x", "a/b", "a\\b", ".x", "-x", "x\0", " x", "c:x", &long]
        {
            assert!(FileName::new(path).is_err(), "{path}");
        }
    }
}
