//! No answer from a server.

use std::io::ErrorKind;
use std::time::Duration;

use crate::protocol::{Fault, MODEL_NOT_FOUND, UNSUPPORTED_FEATURE};

/// Why a question has no answer.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// Nobody is there.
    #[error("no server at {url}: {reason}")]
    Unreachable {
        /// The server's address.
        url: String,
        /// Why.
        reason: String,
    },
    /// The connection broke before the answer was whole.
    #[error("the server at {url} broke the connection: {reason}")]
    Broken {
        /// The server's address.
        url: String,
        /// How.
        reason: String,
    },
    /// The answer takes too long.
    #[error("the server at {url} has not answered within {seconds} s")]
    Slow {
        /// The server's address.
        url: String,
        /// How long it was given.
        seconds: f64,
    },
    /// Somebody is there who does not speak UM-Bridge.
    #[error("the server at {url} does not speak UM-Bridge: it answered {status}{text}")]
    Foreign {
        /// The server's address.
        url: String,
        /// The HTTP status.
        status: u16,
        /// The first line of the answer, after a colon.
        text: String,
    },
    /// The server says what is wrong.
    #[error("the server at {url} reports {fault}")]
    Fault {
        /// The server's address.
        url: String,
        /// What it says.
        fault: Fault,
    },
    /// The answer is none.
    #[error("the answer of the server at {url} cannot be used: {reason}")]
    Useless {
        /// The server's address.
        url: String,
        /// Why.
        reason: String,
    },
}

impl Error {
    /// Whether no other input would be answered either: nobody is there, or nobody who has the model.
    ///
    /// Everything else may be due to the input: a model that crashes, hangs or diverges.
    pub fn is_final(&self) -> bool {
        match self {
            Self::Unreachable { .. } | Self::Foreign { .. } => true,
            Self::Fault { fault, .. } => {
                [MODEL_NOT_FOUND, UNSUPPORTED_FEATURE].contains(&fault.kind.as_str())
            }
            Self::Broken { .. } | Self::Slow { .. } | Self::Useless { .. } => false,
        }
    }

    /// Whether the same question may be answered in a moment.
    pub(super) fn may_pass(&self) -> bool {
        matches!(self, Self::Unreachable { .. } | Self::Broken { .. })
    }

    pub(super) fn of(error: ureq::Error, url: &str, timeout: Duration) -> Self {
        let url = url.to_owned();
        let unreachable = |url, reason: &str| Self::Unreachable { url, reason: reason.to_owned() };
        match error {
            ureq::Error::HostNotFound => unreachable(url, "there is no such host"),
            ureq::Error::ConnectionFailed => unreachable(url, "the connection failed"),
            ureq::Error::BadUri(_) | ureq::Error::Http(_) => {
                unreachable(url, "this is no address, such as `http://localhost:4242`")
            }
            ureq::Error::Timeout(ureq::Timeout::Connect | ureq::Timeout::Resolve) => {
                unreachable(url, "nobody accepts the connection")
            }
            ureq::Error::Timeout(_) => Self::Slow { url, seconds: timeout.as_secs_f64() },
            ureq::Error::Io(io) => match io.kind() {
                ErrorKind::ConnectionRefused => unreachable(url, "the connection is refused"),
                ErrorKind::HostUnreachable | ErrorKind::NetworkUnreachable => {
                    unreachable(url, "there is no way to this host")
                }
                ErrorKind::TimedOut | ErrorKind::WouldBlock => {
                    Self::Slow { url, seconds: timeout.as_secs_f64() }
                }
                ErrorKind::UnexpectedEof
                | ErrorKind::ConnectionReset
                | ErrorKind::ConnectionAborted
                | ErrorKind::BrokenPipe => {
                    Self::Broken { url, reason: "it closed it without an answer".to_owned() }
                }
                // The kind of a name that nobody knows has no name of its own.
                _ if io.to_string().contains("lookup address") => {
                    unreachable(url, "there is no such host")
                }
                _ => Self::Broken { url, reason: io.to_string() },
            },
            ureq::Error::BodyExceedsLimit(limit) => {
                Self::Useless { url, reason: format!("it is longer than {limit} bytes") }
            }
            other => Self::Useless { url, reason: other.to_string() },
        }
    }
}
