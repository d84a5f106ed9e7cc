//! A stage cannot go on.

use thiserror::Error;

/// A stage cannot go on: why, what is saved, and what to do.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{}", self.render())]
pub struct Stop {
    /// What went wrong, with the place and the values found.
    pub message: String,
    /// What was computed and is kept.
    pub saved: Option<String>,
    /// What to do, or how to resume.
    pub help: Option<String>,
}

impl Stop {
    /// A stop for this reason.
    pub fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), saved: None, help: None }
    }

    /// The same stop, saying what is kept.
    #[must_use]
    pub fn saved(mut self, saved: impl Into<String>) -> Self {
        self.saved = Some(saved.into());
        self
    }

    /// The same stop, with advice.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    fn render(&self) -> String {
        let line = |label: &str, text: &Option<String>| {
            text.as_ref().map_or(String::new(), |text| format!("\n{label}: {text}"))
        };
        format!("{}{}{}", self.message, line("saved", &self.saved), line("help", &self.help))
    }
}

impl From<crate::plugin::reader::ReadError> for Stop {
    fn from(error: crate::plugin::reader::ReadError) -> Self {
        Self::new(error.to_string())
    }
}
