//! UM-Bridge server: HTTP/1.1 with persistent connections, one thread per connection.
//!
//! The number of evaluations in parallel is limited; further ones wait for their turn.

mod answer;
mod model;
mod turns;

use std::io::{self, Read, Write};
use std::net::{IpAddr, SocketAddr};
use std::sync::atomic::AtomicU64;

use crate::http::{self, Listener, Request, Response, Site};
use crate::protocol::{Failed, Fault, INTERNAL_ERROR, INVALID_INPUT};

pub use crate::http::Stopper;
pub use model::Model;

use turns::Turns;

/// Largest size of the body of a request, in bytes.
const LONGEST_BODY: usize = 256 * 1024 * 1024;

/// A server that has bound its port and does not respond yet.
pub struct Server(Listener);

/// Data shared by all connections.
struct Shared<'a> {
    models: &'a [&'a dyn Model],
    turns: Turns,
}

impl Server {
    /// Binds a port of an address; port 0 takes any free port.
    pub fn bind(host: IpAddr, port: u16) -> io::Result<Self> {
        Listener::bind(host, port).map(Self)
    }

    /// Address at which the server listens.
    pub fn address(&self) -> SocketAddr {
        self.0.address()
    }

    /// A handle that stops the server.
    pub fn stopper(&self) -> Stopper {
        self.0.stopper()
    }

    /// Responds to requests for these models, with at most `at_a_time` evaluations in parallel, until it is stopped;
    /// returns the number of requests served.
    pub fn serve(&self, models: &[&dyn Model], at_a_time: usize) -> u64 {
        self.0.serve(&Shared { models, turns: Turns::of(at_a_time.max(1)) })
    }
}

/// Responds to the requests of one stream until it ends: the server without its port. Returns the number of requests served.
pub fn converse(stream: impl Read + Write, models: &[&dyn Model]) -> u64 {
    let answered = AtomicU64::new(0);
    let shared = Shared { models, turns: Turns::of(1) };
    http::converse(stream, &shared, || false, &answered);
    answered.into_inner()
}

impl Site for Shared<'_> {
    fn longest_body(&self) -> usize {
        LONGEST_BODY
    }

    fn answer(&self, request: &Request) -> Response {
        let (status, body) = answer::answer(request, self);
        Response::json(status, body)
    }

    fn refusal(&self, status: u16, reason: String) -> Response {
        let kind = if status >= 500 { INTERNAL_ERROR } else { INVALID_INPUT };
        Response::json(status, fault(kind, reason))
    }
}

/// Body of an error response.
fn fault(kind: &str, message: String) -> String {
    let failed = Failed { error: Fault::new(kind, message) };
    serde_json::to_string(&failed).unwrap_or_default()
}

/// HTTP status of a fault, as in the reference implementation.
fn status(fault: &Fault) -> u16 {
    use crate::protocol::{INTERNAL_ERROR, INVALID_OUTPUT};
    if [INVALID_OUTPUT, INTERNAL_ERROR].contains(&fault.kind.as_str()) { 500 } else { 400 }
}

#[cfg(test)]
mod tests;
