//! Names of columns and keys.

use std::borrow::Cow;
use std::fmt::{self, Display};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserializer};
use serde::{Deserialize, Serialize};

use super::Unfit;
use crate::text::node::quoted;

/// A valid name of a column or key: a letter or `_`, then letters, digits and `_`; at most 200 of them.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(transparent)]
pub struct Name(String);

impl Name {
    /// Largest length in bytes: names become those of files and of what is in them, with something added.
    pub const MOST: usize = 200;

    /// Checks that a text is a valid name.
    pub fn new(text: impl Into<String>) -> Result<Self, Unfit> {
        let text = text.into();
        if text.len() > Self::MOST {
            let found = format!("{} bytes: {}", text.len(), quoted(&text));
            return Err(Unfit::new("a name of at most 200 bytes", found));
        }
        let start = text.chars().next().is_some_and(|c| c.is_ascii_alphabetic() || c == '_');
        if start && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            return Ok(Self(text));
        }
        let expected = "a name of letters, digits and `_` that does not begin with a digit";
        Err(Unfit::new(expected, quoted(&text)))
    }

    /// The name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl AsRef<str> for Name {
    fn as_ref(&self) -> &str {
        &self.0
    }
}

impl std::borrow::Borrow<str> for Name {
    fn borrow(&self) -> &str {
        &self.0
    }
}

impl TryFrom<String> for Name {
    type Error = Unfit;

    fn try_from(text: String) -> Result<Self, Unfit> {
        Self::new(text)
    }
}

impl From<Name> for String {
    fn from(name: Name) -> String {
        name.0
    }
}

impl Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl<'de> Deserialize<'de> for Name {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::new(String::deserialize(deserializer)?).map_err(de::Error::custom)
    }
}

impl JsonSchema for Name {
    fn schema_name() -> Cow<'static, str> {
        "Name".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": "^[A-Za-z_][A-Za-z0-9_]*$" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_what_would_be_right() {
        let said = |unfit: Unfit| unfit.to_string();
        assert!(Name::new("x_1").is_ok() && Name::new("x".repeat(200)).is_ok());
        let long = format!(
            "expected a name of at most 200 bytes, found 201 bytes: \"{}…\"",
            "x".repeat(40)
        );
        assert_eq!(Name::new("x".repeat(201)).map_err(said), Err(long));
        assert_eq!(
            Name::new("1 x").map_err(said),
            Err("expected a name of letters, digits and `_` that does not begin with a digit, \
                 found \"1 x\""
                .to_owned())
        );
    }
}
