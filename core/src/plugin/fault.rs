//! That a plugin can answer no more, where its answers have no room for errors.

use std::sync::OnceLock;

/// The first thing that went wrong with somebody, once that has happened: what is computed then means nothing.
///
/// Whoever uses answers of somebody who may have a fault looks here before the answers are kept.
#[derive(Debug)]
pub struct Fault {
    who: String,
    said: OnceLock<String>,
}

impl Fault {
    /// Nothing is wrong with somebody, called `who` in messages.
    pub fn new(who: impl Into<String>) -> Self {
        Self { who: who.into(), said: OnceLock::new() }
    }

    /// Whose fault it is.
    pub fn who(&self) -> &str {
        &self.who
    }

    /// Something went wrong; only the first is kept.
    pub fn report(&self, message: impl std::fmt::Display) {
        let _ = self.said.set(format!("{}: {message}", self.who));
    }

    /// What went wrong, and with whom.
    pub fn said(&self) -> Option<&str> {
        self.said.get().map(String::as_str)
    }
}
