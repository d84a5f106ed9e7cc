//! Faults of an expression, with their place in its text.

use std::fmt;
use std::ops::Range;

/// One fault of an expression.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Name of the definition whose text is at fault; empty for a text on its own.
    pub definition: String,
    /// Byte range at fault; empty at a place where something is missing.
    pub span: Range<usize>,
    /// Description of the fault, in one line.
    pub message: String,
    /// The correct form, phrased to follow "expected".
    pub expected: Option<Box<str>>,
    /// The text or value present, phrased to follow "found".
    pub found: Option<Box<str>>,
    /// Advice to the user.
    pub help: Option<Box<str>>,
}

impl Fault {
    /// A fault at this byte range.
    pub fn new(span: Range<usize>, message: impl Into<String>) -> Self {
        Self {
            definition: String::new(),
            span,
            message: message.into(),
            expected: None,
            found: None,
            help: None,
        }
    }

    /// Adds the correct form.
    #[must_use]
    pub fn expected(mut self, expected: impl Into<String>) -> Self {
        self.expected = Some(expected.into().into());
        self
    }

    /// Adds the text or value present.
    #[must_use]
    pub fn found(mut self, found: impl Into<String>) -> Self {
        self.found = Some(found.into().into());
        self
    }

    /// Adds advice.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into().into());
        self
    }

    /// Sets the name of the definition.
    #[must_use]
    pub(super) fn within(mut self, definition: &str) -> Self {
        definition.clone_into(&mut self.definition);
        self
    }

    /// Renders the fault with the line of the text that contains it, marked.
    ///
    /// ```
    /// # use lacuna_base as lacuna;
    /// let fault = lacuna::expression::check("exp(a, 2)").unwrap_err();
    /// assert_eq!(
    ///     fault.render("exp(a, 2)"),
    ///     "wrong number of arguments for `exp`\n\
    ///      | exp(a, 2)\n\
    ///      | ^^^^^^^^^\n\
    ///      = expected `exp(x)`, found 2 arguments\n",
    /// );
    /// ```
    pub fn render(&self, text: &str) -> String {
        let start = floor_char(text, self.span.start);
        let end = floor_char(text, self.span.end).max(start);
        let from = text[..start].rfind('\n').map_or(0, |newline| newline + 1);
        let line = text[from..].lines().next().unwrap_or("").replace('\t', " ");
        let left = text[from..start].chars().count();
        let width = text[start..end].lines().next().unwrap_or("").chars().count().max(1);
        let mut shown =
            format!("{}\n| {line}\n| {:left$}{}\n", self.message, "", "^".repeat(width));
        let note = match (&self.expected, &self.found) {
            (Some(expected), Some(found)) => format!("= expected {expected}, found {found}\n"),
            (Some(expected), None) => format!("= expected {expected}\n"),
            (None, Some(found)) => format!("= found {found}\n"),
            (None, None) => String::new(),
        };
        shown.push_str(&note);
        if let Some(help) = &self.help {
            shown.push_str(&format!("= help: {help}\n"));
        }
        shown
    }
}

/// One line: the message, what was expected and found, the advice.
impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.definition.is_empty() {
            write!(f, "`{}`: ", self.definition)?;
        }
        f.write_str(&self.message)?;
        match (&self.expected, &self.found) {
            (Some(expected), Some(found)) => write!(f, ": expected {expected}, found {found}")?,
            (Some(expected), None) => write!(f, ": expected {expected}")?,
            (None, Some(found)) => write!(f, ": found {found}")?,
            (None, None) => {}
        }
        self.help.as_ref().map_or(Ok(()), |help| write!(f, " (help: {help})"))
    }
}

impl std::error::Error for Fault {}

/// The last character boundary at or before `byte`.
fn floor_char(text: &str, byte: usize) -> usize {
    let mut at = byte.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}
