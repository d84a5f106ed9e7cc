//! One client connection: its requests, one after the other.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use super::Site;
use super::listener::Shared;
use super::reader::{Nothing, Reader};

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
    let (stopper, answered) = (shared.stopper, &shared.answered);
    converse(stream, shared.site, || stopper.is_stopped(), answered);
}

/// Serves the requests of a stream until it ends or `stopped` says so; `answered` counts them.
pub(crate) fn converse(
    stream: impl Read + Write,
    site: &dyn Site,
    stopped: impl Fn() -> bool,
    answered: &AtomicU64,
) {
    let mut reader = Reader::new(stream, site.longest_body());
    loop {
        match reader.next(&stopped) {
            Ok(request) => {
                // A panic must fail only its own request.
                let response = catch_unwind(AssertUnwindSafe(|| site.answer(&request)));
                let response =
                    response.unwrap_or_else(|_| site.refusal(500, "the server failed".to_owned()));
                answered.fetch_add(1, Ordering::Relaxed);
                let stays = request.stays && !stopped();
                let head_only = request.method == "HEAD";
                if reader.answer(response, head_only, stays).is_err() || !stays {
                    return;
                }
            }
            Err(Nothing::Refused(status, reason)) => {
                // The client may have disconnected already; then the reason reaches nobody.
                let _ = reader.answer(site.refusal(status, reason), false, false);
                return;
            }
            Err(Nothing::End) => return,
        }
    }
}

/// Rejects a client because there are too many.
pub(super) fn refuse(stream: TcpStream, shared: &Shared<'_>) {
    let _ = stream.set_write_timeout(Some(GLANCE));
    let mut reader = Reader::new(stream, 0);
    let text = "too many connections are open".to_owned();
    let _ = reader.answer(shared.site.refusal(503, text), false, false);
}
