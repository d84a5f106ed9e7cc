//! Texts with placeholders for values: `density = {{ density | %.6e }}`.
//!
//! A placeholder is `{{`, a name, optionally `|` and a format, and `}}`, all on one line. There are no expressions
//! and no conditions. A text that contains a literal `{{` cannot be written.

use std::fmt;
use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::number::{Format, shortest};

/// A text with placeholders for values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Template {
    text: String,
    pieces: Vec<Piece>,
}

impl JsonSchema for Template {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Template".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        String::json_schema(generator)
    }
}

#[derive(Debug, Clone, PartialEq)]
enum Piece {
    Text(Range<usize>),
    Place(Place),
}

/// A placeholder.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// Name of the value.
    pub name: String,
    /// Format of the value, if given.
    pub format: Option<Format>,
    /// Byte range of the name in the text.
    pub at: Range<usize>,
}

/// A value for a placeholder.
#[derive(Debug, Clone, PartialEq)]
pub enum Filling {
    /// Number, written in the placeholder's format.
    Number(f64),
    /// Text, for placeholders without a format.
    Text(String),
}

/// An error in a template, with its position.
#[derive(Debug, Clone, PartialEq)]
pub struct TemplateError {
    /// Description.
    pub message: String,
    /// Start of the error in the text, in bytes.
    pub at: usize,
}

impl Template {
    /// Parses a text with its placeholders.
    pub fn parse(text: impl Into<String>) -> Result<Self, TemplateError> {
        let text = text.into();
        let mut pieces = Vec::new();
        let mut done = 0;
        while let Some(open) = text[done..].find("{{").map(|i| done + i) {
            let inside = open + 2;
            let line = text[inside..].lines().next().unwrap_or("");
            let fault = |message: String| TemplateError { message, at: open };
            let length =
                line.find("}}").ok_or_else(|| fault("`{{` without `}}` on its line".to_owned()))?;
            pieces.push(Piece::Text(done..open));
            pieces.push(Piece::Place(place(&text, inside..inside + length).map_err(fault)?));
            done = inside + length + 2;
        }
        pieces.push(Piece::Text(done..text.len()));
        Ok(Self { text, pieces })
    }

    /// Returns the text with its placeholders.
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// Iterates over the placeholders in order.
    pub fn places(&self) -> impl Iterator<Item = &Place> {
        self.pieces.iter().filter_map(|piece| match piece {
            Piece::Place(place) => Some(place),
            Piece::Text(_) => None,
        })
    }

    /// Replaces the placeholders by values; the error is a name without a value.
    pub fn fill(&self, value: impl Fn(&str) -> Option<Filling>) -> Result<String, String> {
        let mut filled = String::with_capacity(self.text.len());
        for piece in &self.pieces {
            match piece {
                Piece::Text(range) => filled.push_str(&self.text[range.clone()]),
                Piece::Place(place) => match value(&place.name) {
                    None => return Err(place.name.clone()),
                    Some(Filling::Text(text)) => filled.push_str(&text),
                    Some(Filling::Number(x)) => {
                        filled.push_str(&place.format.map_or_else(|| shortest(x), |f| f.write(x)));
                    }
                },
            }
        }
        Ok(filled)
    }

    /// Returns line and column, both counted from 1, of a byte of the text.
    pub fn position(text: &str, at: usize) -> (usize, usize) {
        let before = &text[..at];
        let start = before.rfind('\n').map_or(0, |newline| newline + 1);
        (before.matches('\n').count() + 1, before[start..].chars().count() + 1)
    }
}

/// Parses the text between the braces.
fn place(text: &str, range: Range<usize>) -> Result<Place, String> {
    let inside = &text[range.clone()];
    let (name, format) = match inside.split_once('|') {
        Some((name, format)) => (name, Some(format.trim())),
        None => (inside, None),
    };
    let start = range.start + (name.len() - name.trim_start().len());
    let name = name.trim();
    // Brackets: the values of a field at its places are `name[1]` and so on.
    let letters = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '[' | ']');
    if name.is_empty() || !name.chars().all(letters) {
        return Err(format!(
            "expected a name between `{{{{` and `}}}}`, found `{}`",
            inside.trim()
        ));
    }
    let format = format.map(|text| {
        Format::parse(text).ok_or_else(|| {
            format!("expected a format such as `%.6e`, `%12.4f` or `%g`, found `{text}`")
        })
    });
    Ok(Place { name: name.to_owned(), format: format.transpose()?, at: start..start + name.len() })
}

impl fmt::Display for TemplateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl TryFrom<String> for Template {
    type Error = TemplateError;

    fn try_from(text: String) -> Result<Self, TemplateError> {
        Self::parse(text)
    }
}

impl From<Template> for String {
    fn from(template: Template) -> String {
        template.text
    }
}
