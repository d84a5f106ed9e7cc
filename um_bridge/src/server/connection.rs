//! One client connection: its requests, one after the other.

use std::net::TcpStream;
use std::sync::atomic::Ordering;
use std::time::Duration;

use super::http::{Nothing, Reader};
use super::{Shared, answer};
use crate::protocol::{Failed, Fault, INTERNAL_ERROR, INVALID_INPUT};

/// Interval at which an idle connection checks whether the server is stopping.
const GLANCE: Duration = Duration::from_millis(200);
/// Longest time a client may take to receive a part of its response.
const RECEIVING: Duration = Duration::from_secs(30);

/// Serves requests until the client disconnects or the server stops.
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
                // The client may have disconnected already; then the reason reaches nobody.
                let _ = reader.answer(status, &fault(INVALID_INPUT, reason), false);
                return;
            }
            Err(Nothing::End) => return,
        }
    }
}

/// Rejects a client because there are too many.
pub(super) fn refuse(stream: TcpStream) {
    let _ = stream.set_write_timeout(Some(GLANCE));
    let mut reader = Reader::new(stream);
    let text = "too many connections are open".to_owned();
    let _ = reader.answer(503, &fault(INTERNAL_ERROR, text), false);
}

/// Body of an error response.
pub(super) fn fault(kind: &str, message: String) -> String {
    let failed = Failed { error: Fault::new(kind, message) };
    serde_json::to_string(&failed).unwrap_or_default()
}
