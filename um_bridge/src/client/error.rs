//! Errors of the client.

use std::io::ErrorKind;
use std::time::Duration;

use crate::protocol::{Fault, MODEL_NOT_FOUND, UNSUPPORTED_FEATURE};

/// Reason why a request failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// No server responds at the address.
    #[error("no server at {url}: {reason}")]
    Unreachable {
        /// Address of the server.
        url: String,
        /// Reason.
        reason: String,
    },
    /// The connection broke before the response was complete.
    #[error("the server at {url} broke the connection: {reason}")]
    Broken {
        /// Address of the server.
        url: String,
        /// Description of the failure.
        reason: String,
    },
    /// The response took too long.
    #[error("the server at {url} has not answered within {seconds} s")]
    Slow {
        /// Address of the server.
        url: String,
        /// Time limit, in seconds.
        seconds: f64,
    },
    /// The server does not speak UM-Bridge.
    #[error("the server at {url} does not speak UM-Bridge: it answered {status}{text}")]
    Foreign {
        /// Address of the server.
        url: String,
        /// HTTP status.
        status: u16,
        /// First line of the response, after a colon.
        text: String,
    },
    /// The server refers to another address.
    #[error("the server at {url} refers to `{to}`: write the address of the server itself")]
    Moved {
        /// Address of the server.
        url: String,
        /// Address that it names.
        to: String,
    },
    /// The server reported an error.
    #[error("the server at {url} reports {fault}")]
    Fault {
        /// Address of the server.
        url: String,
        /// The error that the server reported.
        fault: Fault,
    },
    /// The response has no usable content.
    #[error("the answer of the server at {url} cannot be used: {reason}")]
    Useless {
        /// Address of the server.
        url: String,
        /// Reason.
        reason: String,
    },
}

impl Error {
    /// Returns true if requests with other inputs would fail too, because there is no server or none with the model.
    ///
    /// Any other failure may be due to the input: a model that crashes, hangs or diverges.
    pub fn is_final(&self) -> bool {
        match self {
            Self::Unreachable { .. } | Self::Foreign { .. } | Self::Moved { .. } => true,
            Self::Fault { fault, .. } => {
                [MODEL_NOT_FOUND, UNSUPPORTED_FEATURE].contains(&fault.kind.as_str())
            }
            Self::Broken { .. } | Self::Slow { .. } | Self::Useless { .. } => false,
        }
    }

    /// Returns true if the same request may succeed a moment later.
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
                // The error for an unknown host name has no kind of its own.
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
