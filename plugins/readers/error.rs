//! One complaint about a file.

use std::fmt;
use std::path::{Path, PathBuf};

/// Why a file could not be read: which file, where in it, what was found and what would be right.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReadError {
    /// The file complained about.
    pub file: PathBuf,
    /// Line in a text file, counted from 1.
    pub line: Option<usize>,
    /// What is wrong, in lower case without a full stop.
    pub message: String,
}

impl ReadError {
    /// A complaint about the file as a whole.
    pub fn new(file: &Path, message: impl Into<String>) -> Self {
        Self { file: file.to_owned(), line: None, message: message.into() }
    }

    /// A complaint about one line of a text file, counted from 1.
    pub fn at_line(file: &Path, line: usize, message: impl Into<String>) -> Self {
        Self { file: file.to_owned(), line: Some(line), message: message.into() }
    }
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}`", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, " line {line}")?;
        }
        write!(f, ": {}", self.message)
    }
}

impl std::error::Error for ReadError {}

/// Shows names to a user: all of a short list, the beginning of a long one.
pub(crate) fn listed<S: AsRef<str>>(names: &[S]) -> String {
    const SHOWN: usize = 12;
    let mut text: Vec<String> =
        names.iter().take(SHOWN).map(|name| format!("`{}`", name.as_ref())).collect();
    if names.len() > SHOWN {
        text.push(format!("and {} more", names.len() - SHOWN));
    }
    if text.is_empty() { "none".to_owned() } else { text.join(", ") }
}
