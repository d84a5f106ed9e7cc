//! Why a call across the boundary has no answer.

use lacuna::plugin::model::EvalError;
use lacuna::plugin::reader::ReadError;
use lacuna::run::Stop;

use crate::status;

/// A status other than `OK`, and its message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// See [`status`].
    pub status: i32,
    /// The message of the other side.
    pub message: String,
}

impl Refusal {
    /// A refusal with this status.
    pub fn new(status: i32, message: impl Into<String>) -> Self {
        Self { status, message: message.into() }
    }

    /// The stage cannot go on.
    pub fn stop(message: impl Into<String>) -> Self {
        Self::new(status::STOP, message)
    }

    /// A refusal of what is not there, which is no error.
    pub fn absent() -> Self {
        Self::new(status::ABSENT, String::new())
    }

    /// A text of the other side that is not what it should be.
    pub fn unreadable(what: &str, error: impl std::fmt::Display) -> Self {
        Self::stop(format!("{what} cannot be read: {error}"))
    }
}

impl From<Stop> for Refusal {
    fn from(stop: Stop) -> Self {
        Self::stop(stop.to_string())
    }
}

impl From<EvalError> for Refusal {
    fn from(error: EvalError) -> Self {
        match error {
            EvalError::Rejected(message) => Self::new(status::REJECTED, message),
            EvalError::Fatal(message) => Self::new(status::FATAL, message),
        }
    }
}

impl From<ReadError> for Refusal {
    fn from(error: ReadError) -> Self {
        Self::new(status::REJECTED, told(&error).to_string())
    }
}

fn told(error: &ReadError) -> serde_json::Value {
    let ReadError { path, place, message, help, further } = error;
    let further: Vec<_> = further.iter().map(told).collect();
    serde_json::json!({
        "path": path, "place": place, "message": message, "help": help, "further": further,
    })
}

impl From<serde_json::Error> for Refusal {
    fn from(error: serde_json::Error) -> Self {
        Self::unreadable("a text", error)
    }
}
