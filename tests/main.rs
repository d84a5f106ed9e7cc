//! Tests of the whole, in one binary.
// A test that cannot go on has failed: here a panic is the message.
#![allow(clippy::unwrap_used)]

mod bad_input;
mod docs;
mod kill;
mod problems;
mod python;
mod quick;
mod studies;
mod tidy;
