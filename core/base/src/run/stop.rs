//! Error of a stage that cannot continue.

use thiserror::Error;

/// A stage cannot continue: the reason, what has been saved, and what to do.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{}", self.render())]
pub struct Stop {
    /// Description of the problem, with its place and the values found.
    pub message: String,
    /// Results that were computed and are kept.
    pub saved: Option<String>,
    /// Advice on what to do, or how to resume.
    pub help: Option<String>,
}

impl Stop {
    /// A stop with this message.
    pub fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), saved: None, help: None }
    }

    /// Adds what has been saved.
    #[must_use]
    pub fn saved(mut self, saved: impl Into<String>) -> Self {
        self.saved = Some(saved.into());
        self
    }

    /// Adds advice.
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
