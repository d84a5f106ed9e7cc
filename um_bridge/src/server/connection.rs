//! One client: its questions, one after the other.

use std::net::TcpStream;
use std::sync::atomic::Ordering;
use std::time::Duration;

use super::http::{Nothing, Reader};
use super::{Shared, answer};
use crate::protocol::{Failed, Fault, INTERNAL_ERROR, INVALID_INPUT};

/// How often a connection without questions looks whether the server stops.
const GLANCE: Duration = Duration::from_millis(200);
/// The longest a client may take to receive some of its answer.
const RECEIVING: Duration = Duration::from_secs(30);

/// Answers until the client leaves or the server stops.
pub(super) fn attend(stream: TcpStream, shared: &Shared<'_>) {
    let prepared = stream
        .set_nodelay(true)
        .and_then(|()| stream.set_read_timeout(Some(GLANCE)))
        .and_then(|()| stream.set_write_timeout(Some(RECEIVING)));
    if prepared.is_err() {
        return;
    }
    let mut reader = Reader::new(stream);
    loop {
        match reader.next(|| shared.stopper.is_stopped()) {
            Ok(request) => {
                let (status, body) = answer::answer(&request, shared);
                shared.answered.fetch_add(1, Ordering::Relaxed);
                let stays = request.stays && !shared.stopper.is_stopped();
                if reader.answer(status, &body, stays).is_err() || !stays {
                    return;
                }
            }
            Err(Nothing::Refused(status, reason)) => {
                // A client that is gone needs no reason.
                let _ = reader.answer(status, &fault(INVALID_INPUT, reason), false);
                return;
            }
            Err(Nothing::End) => return,
        }
    }
}

/// Turns a client away because there are too many.
pub(super) fn refuse(stream: TcpStream) {
    let _ = stream.set_write_timeout(Some(GLANCE));
    let mut reader = Reader::new(stream);
    let text = "too many connections are open".to_owned();
    let _ = reader.answer(503, &fault(INTERNAL_ERROR, text), false);
}

/// The body of an error.
pub(super) fn fault(kind: &str, message: String) -> String {
    let failed = Failed { error: Fault::new(kind, message) };
    serde_json::to_string(&failed).unwrap_or_default()
}
