//! Faults of a plugin whose interface has no room for errors.

use std::sync::OnceLock;

/// The first error of a component, once it has occurred; results computed from then on are meaningless.
///
/// A caller that uses results of such a component checks this before it keeps them.
#[derive(Debug)]
pub struct Fault {
    who: String,
    said: OnceLock<String>,
}

impl Fault {
    /// No fault yet of the component that messages call `who`.
    pub fn new(who: impl Into<String>) -> Self {
        Self { who: who.into(), said: OnceLock::new() }
    }

    /// Name of the component in messages.
    pub fn who(&self) -> &str {
        &self.who
    }

    /// Records an error; only the first is kept.
    pub fn report(&self, message: impl std::fmt::Display) {
        let _ = self.said.set(format!("{}: {message}", self.who));
    }

    /// The recorded error, with the name of the component; `None` if there is none.
    pub fn said(&self) -> Option<&str> {
        self.said.get().map(String::as_str)
    }
}
