//! Tests of the whole, in one binary.

mod docs;
mod problems;
