//! HTTP server for one machine or one network: the subset of HTTP/1.1 (RFC 9112) of requests with a body of known length,
//! persistent connections, one thread per connection, and limits on what a client may send.

mod connection;
mod listener;
mod reader;

use std::fs::File;

pub(crate) use connection::converse;
pub use listener::{Listener, Stopper};

/// A request.
#[derive(Debug, PartialEq, Eq)]
pub struct Request {
    /// Method, such as `GET`.
    pub method: String,
    /// Path without the query, as it was sent.
    pub path: String,
    /// Query without the question mark, as it was sent.
    pub query: String,
    /// Header `Host` in small letters; `None` if there is none, or several.
    pub host: Option<String>,
    /// Body of the request.
    pub body: Vec<u8>,
    /// True if the client keeps the connection open.
    pub stays: bool,
}

/// A response.
#[derive(Debug)]
pub struct Response {
    /// HTTP status.
    pub status: u16,
    /// Media type of the body.
    pub kind: &'static str,
    /// Further headers: names and values.
    pub headers: Vec<(&'static str, String)>,
    /// Body of the response.
    pub body: Body,
}

/// Body of a response.
#[derive(Debug)]
pub enum Body {
    /// Bytes in memory.
    Bytes(Vec<u8>),
    /// The first bytes of a file, this many.
    File(File, u64),
}

impl Response {
    /// A response in JSON.
    pub fn json(status: u16, text: String) -> Self {
        let (kind, body) = ("application/json", Body::Bytes(text.into_bytes()));
        Self { status, kind, headers: Vec::new(), body }
    }
}

/// Contents of a server.
pub trait Site: Sync {
    /// Largest size of the body of a request, in bytes.
    fn longest_body(&self) -> usize;

    /// The response to a request.
    fn answer(&self, request: &Request) -> Response;

    /// The response to a request that is rejected with this status for this reason, or that failed.
    fn refusal(&self, status: u16, reason: String) -> Response;
}
