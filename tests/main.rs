//! Tests of the whole, in one binary.

mod bad_input;
mod docs;
mod kill;
mod problems;
mod python;
mod quick;
mod studies;
mod tidy;
