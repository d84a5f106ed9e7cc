//! Requests of a connection, and responses to them.

use std::io::{self, ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use super::{Body, Request, Response};

/// Largest size of the head of a request, in bytes.
const LONGEST_HEAD: usize = 16 * 1024;
/// Longest pause of a client in the middle of a request.
const PATIENCE: Duration = Duration::from_secs(30);
/// Time for which a connection stays open without a request.
const IDLE: Duration = Duration::from_secs(120);

/// Outcome of waiting for a request, other than a request.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Nothing {
    /// The client disconnected, or the server is stopping.
    End,
    /// The request is rejected, with this HTTP status and reason.
    Refused(u16, String),
}

/// The relevant part of a head.
struct Head {
    method: String,
    path: String,
    query: String,
    host: Option<String>,
    length: usize,
    stays: bool,
    /// True if the client waits for `100 Continue` before it sends the body.
    waits: bool,
    /// Length of the head itself, in bytes.
    end: usize,
}

/// Reads requests from a connection whose reads time out regularly.
pub(super) struct Reader<S> {
    stream: S,
    /// Bytes read beyond the last request.
    buffer: Vec<u8>,
    /// Largest size of a body, in bytes.
    longest: usize,
}

impl<S: Read + Write> Reader<S> {
    pub(super) fn new(stream: S, longest: usize) -> Self {
        Self { stream, buffer: Vec::new(), longest }
    }

    /// Waits for the next request; `stop` returns true if waiting should end.
    pub(super) fn next(&mut self, stop: impl Fn() -> bool) -> Result<Request, Nothing> {
        let head = loop {
            let found = head(&self.buffer, self.longest)?;
            let length = found.as_ref().map_or(self.buffer.len(), |head| head.end);
            if length > LONGEST_HEAD {
                return Err(Nothing::Refused(431, "the head of the request is too long".into()));
            }
            if let Some(head) = found {
                break head;
            }
            let idle = self.buffer.is_empty();
            let patience = if idle { IDLE } else { PATIENCE };
            self.more(patience, || idle && stop())?;
        };
        if head.waits && self.buffer.len() == head.end {
            let word = self.stream.write_all(b"HTTP/1.1 100 Continue\r\n\r\n");
            word.map_err(|_| Nothing::End)?;
        }
        let whole = head.end + head.length;
        while self.buffer.len() < whole {
            self.more(PATIENCE, || false)?;
        }
        let rest = self.buffer.split_off(whole);
        let body = std::mem::replace(&mut self.buffer, rest).split_off(head.end);
        let Head { method, path, query, host, stays, .. } = head;
        Ok(Request { method, path, query, host, body, stays })
    }

    /// Reads more bytes, waiting at most for `patience`.
    fn more(&mut self, patience: Duration, stop: impl Fn() -> bool) -> Result<(), Nothing> {
        let begun = Instant::now();
        let mut chunk = [0; 16 * 1024];
        while !stop() && begun.elapsed() < patience {
            match self.stream.read(&mut chunk) {
                Ok(0) => return Err(Nothing::End),
                Ok(count) => {
                    self.buffer.extend_from_slice(&chunk[..count]);
                    return Ok(());
                }
                Err(error) if is_pause(&error) => {}
                Err(_) => return Err(Nothing::End),
            }
        }
        Err(Nothing::End)
    }

    /// Writes a response; without its body if only the head was asked.
    pub(super) fn answer(
        &mut self,
        response: Response,
        head_only: bool,
        stays: bool,
    ) -> io::Result<()> {
        let Response { status, kind, headers, body } = response;
        let length = match &body {
            Body::Bytes(bytes) => bytes.len() as u64,
            Body::File(_, length) => *length,
        };
        let connection = if stays { "keep-alive" } else { "close" };
        let mut text = format!(
            "HTTP/1.1 {status} {}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n\
             Connection: {connection}\r\n",
            reason(status)
        );
        for (name, value) in headers {
            // A value with an end of line would begin a header of its own.
            let value: String = value.chars().filter(|c| !c.is_control()).collect();
            text.push_str(&format!("{name}: {value}\r\n"));
        }
        text.push_str("\r\n");
        let mut bytes = text.into_bytes();
        match body {
            _ if head_only => self.stream.write_all(&bytes)?,
            Body::Bytes(body) => {
                bytes.extend(body);
                self.stream.write_all(&bytes)?;
            }
            Body::File(file, length) => {
                self.stream.write_all(&bytes)?;
                let sent = io::copy(&mut file.take(length), &mut self.stream)?;
                if sent < length {
                    // The file has become shorter: only a closed connection tells the client.
                    return Err(io::Error::from(ErrorKind::UnexpectedEof));
                }
            }
        }
        self.stream.flush()
    }
}

fn is_pause(error: &io::Error) -> bool {
    [ErrorKind::WouldBlock, ErrorKind::TimedOut, ErrorKind::Interrupted].contains(&error.kind())
}

/// Parses the head at the beginning of these bytes; `None` if it is not complete yet.
fn head(bytes: &[u8], longest: usize) -> Result<Option<Head>, Nothing> {
    let mut headers = [httparse::EMPTY_HEADER; 100];
    let mut request = httparse::Request::new(&mut headers);
    let end = match request.parse(bytes) {
        Ok(httparse::Status::Complete(end)) => end,
        Ok(httparse::Status::Partial) => return Ok(None),
        Err(error) => return Err(Nothing::Refused(400, format!("this is no HTTP: {error}"))),
    };
    let method = request.method.unwrap_or_default().to_owned();
    let target = request.path.unwrap_or_default();
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let (path, query) = (path.to_owned(), query.to_owned());
    let header = |name: &str| {
        let found = request.headers.iter().find(|h| h.name.eq_ignore_ascii_case(name));
        found.map(|h| String::from_utf8_lossy(h.value).trim().to_ascii_lowercase())
    };
    if header("transfer-encoding").is_some() {
        let text = "a body of unknown length is not read: send `Content-Length`";
        return Err(Nothing::Refused(411, text.to_owned()));
    }
    // A browser sends the origin of a page with its questions; a page that a user visits must neither start a model nor read runs.
    if let Some(origin) = header("origin") {
        let text = format!("questions of web pages are not answered; this one is of `{origin}`");
        return Err(Nothing::Refused(403, text));
    }
    let lengths = request.headers.iter().filter(|h| h.name.eq_ignore_ascii_case("content-length"));
    if lengths.count() > 1 {
        // RFC 9112, section 6.3: which of them ends the body is not known.
        return Err(Nothing::Refused(400, "there is more than one `Content-Length`".to_owned()));
    }
    let length = match header("content-length") {
        None => 0,
        // RFC 9110, section 8.6: digits alone; a sign could mean another end of the body to a proxy.
        Some(text) => (text.bytes().all(|byte| byte.is_ascii_digit()))
            .then(|| text.parse().ok())
            .flatten()
            .ok_or_else(|| {
                let text = format!("`Content-Length` is `{text}`, not a number of bytes");
                Nothing::Refused(400, text)
            })?,
    };
    if length > longest {
        let text = format!("a body of {length} bytes is too long; the most is {longest}");
        return Err(Nothing::Refused(413, text));
    }
    let connection = header("connection").unwrap_or_default();
    let stays = match request.version {
        Some(1) => !connection.contains("close"),
        _ => connection.contains("keep-alive"),
    };
    let waits = header("expect").is_some_and(|text| text == "100-continue");
    // Two of them are no proof of either.
    let hosts = request.headers.iter().filter(|h| h.name.eq_ignore_ascii_case("host")).count();
    let host = header("host").filter(|_| hosts == 1);
    Ok(Some(Head { method, path, query, host, length, stays, waits, end }))
}

fn reason(status: u16) -> &'static str {
    match status {
        200 => "OK",
        303 => "See Other",
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        409 => "Conflict",
        411 => "Length Required",
        413 => "Content Too Large",
        421 => "Misdirected Request",
        431 => "Request Header Fields Too Large",
        503 => "Service Unavailable",
        _ => "Internal Server Error",
    }
}
