//! One decoding error, with the values that enclose it.

use std::fmt::{self, Display};

use serde::de::{self, Expected, Unexpected};

use crate::text::node::{Node, quoted};
use crate::text::source::Place;

/// A decoding error on its way from a value up to the root.
#[derive(Debug)]
pub(super) struct Fault(Box<Inner>);

#[derive(Debug)]
pub(super) struct Inner {
    pub cause: Cause,
    pub place: Option<Place>,
    /// The value at fault and the values that enclose it, innermost first.
    pub trail: Vec<*const Node>,
    /// Keys and names along the way, innermost first.
    steps: Vec<String>,
}

#[derive(Debug)]
pub(super) enum Cause {
    Missing(String),
    UnknownKey {
        key: String,
        known: Vec<String>,
    },
    UnknownVariant {
        name: String,
        known: Vec<String>,
    },
    Wrong {
        message: Option<String>,
        expected: Option<String>,
        found: Option<String>,
        help: Option<String>,
    },
    /// A value that was filled in did not fit.
    Hole,
}

impl std::ops::Deref for Fault {
    type Target = Inner;

    fn deref(&self) -> &Inner {
        &self.0
    }
}

impl Fault {
    pub fn new(cause: Cause) -> Self {
        Self(Box::new(Inner { cause, place: None, trail: Vec::new(), steps: Vec::new() }))
    }

    /// The value has the wrong type.
    pub fn wrong(expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self::new(Cause::Wrong {
            message: None,
            expected: Some(expected.into()),
            found: Some(found.into()),
            help: None,
        })
    }

    pub fn help(mut self, advice: impl Into<String>) -> Self {
        if let Cause::Wrong { help, .. } = &mut self.0.cause {
            *help = Some(advice.into());
        }
        self
    }

    /// Sets the place unless a value further inside has set it.
    pub fn at(mut self, place: &Place) -> Self {
        self.0.place.get_or_insert_with(|| place.clone());
        self
    }

    /// Records that the error passes through `node`, the value of `step`.
    pub fn inside(self, node: &Node, step: Option<&str>) -> Self {
        let mut fault = self.at(&node.place);
        fault.0.trail.push(std::ptr::from_ref(node));
        fault.0.steps.extend(step.map(str::to_owned));
        fault
    }

    /// Dotted path from the root that is being decoded.
    pub fn path(&self) -> String {
        self.0.steps.iter().rev().map(String::as_str).collect::<Vec<_>>().join(".")
    }
}

impl Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.0.cause)
    }
}

impl std::error::Error for Fault {}

impl de::Error for Fault {
    fn custom<T: Display>(message: T) -> Self {
        Self::new(convention(&message.to_string()))
    }

    fn invalid_type(unexpected: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::wrong(plain_expected(&expected.to_string()), plain_found(&unexpected))
    }

    fn invalid_value(unexpected: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::invalid_type(unexpected, expected)
    }

    fn invalid_length(len: usize, expected: &dyn Expected) -> Self {
        let found = if len == 1 { "1 value".to_owned() } else { format!("{len} values") };
        Self::wrong(plain_expected(&expected.to_string()), found)
    }

    fn unknown_variant(name: &str, known: &'static [&'static str]) -> Self {
        Self::new(Cause::UnknownVariant { name: name.to_owned(), known: owned(known) })
    }

    fn unknown_field(key: &str, known: &'static [&'static str]) -> Self {
        Self::new(Cause::UnknownKey { key: key.to_owned(), known: owned(known) })
    }

    fn missing_field(key: &'static str) -> Self {
        Self::new(Cause::Missing(key.to_owned()))
    }

    fn duplicate_field(key: &'static str) -> Self {
        Self::custom(format!("`{key}` is given twice, under two of its names"))
    }
}

pub(super) fn owned(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

/// Parses `expected …, found …; help: …`.
fn convention(text: &str) -> Cause {
    let (text, help) = match text.split_once("; help: ") {
        Some((text, help)) => (text, Some(help.to_owned())),
        None => (text, None),
    };
    let (message, expected, found) = match text.strip_prefix("expected ") {
        None => (Some(text.to_owned()), None, None),
        Some(rest) => match rest.split_once(", found ") {
            Some((expected, found)) => (None, Some(expected.to_owned()), Some(found.to_owned())),
            None => (None, Some(rest.to_owned()), None),
        },
    };
    Cause::Wrong { message, expected, found, help }
}

fn plain_found(unexpected: &Unexpected<'_>) -> String {
    match unexpected {
        Unexpected::Bool(b) => b.to_string(),
        Unexpected::Unsigned(i) => i.to_string(),
        Unexpected::Signed(i) => i.to_string(),
        Unexpected::Float(x) => crate::text::emit::float(*x),
        Unexpected::Char(c) => quoted(&c.to_string()),
        Unexpected::Str(text) => quoted(text),
        Unexpected::Seq => "an array".to_owned(),
        Unexpected::Map => "a table".to_owned(),
        Unexpected::Other(text) => (*text).to_owned(),
        _ => "something else".to_owned(),
    }
}

/// Rephrases what serde's own visitors expect in the terms of a study.
fn plain_expected(text: &str) -> String {
    let words = match text {
        "u8" => "a whole number from 0 to 255",
        "u16" => "a whole number from 0 to 65535",
        "u32" => "a whole number from 0 to 4294967295",
        "u64" | "usize" => "a whole number of 0 or more",
        "nonzero u32" | "nonzero u64" | "nonzero usize" | "a nonzero usize" | "a nonzero u64" => {
            "a whole number of 1 or more"
        }
        "i8" => "a whole number from -128 to 127",
        "i16" | "i32" | "i64" | "isize" => "a whole number",
        "f32" | "f64" => "a number",
        "a boolean" => "`true` or `false`",
        "a sequence" => "an array",
        "a map" => "a table",
        _ if text.starts_with("a tuple of size ") => {
            return format!("{} values", &text["a tuple of size ".len()..]);
        }
        _ if text.starts_with("an array of length ") => {
            return format!("{} values", &text["an array of length ".len()..]);
        }
        _ if text.starts_with("tuple ") && text.ends_with(" elements") => {
            let count = text.trim_end_matches(" elements").rsplit(' ').next().unwrap_or("more");
            return format!("{count} values");
        }
        _ if text.starts_with("struct ") => "a table",
        _ if text.starts_with("enum ") => "a name or a table with one key",
        _ => text,
    };
    words.to_owned()
}
