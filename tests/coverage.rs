//! Whether what is printed as an uncertainty is one: `lacuna coverage`, and the standing gate.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

#[path = "coverage/verb.rs"]
mod verb;

#[allow(dead_code, reason = "the tests of the whole use the rest")]
mod quick;

mod gate;
