//! No library: the tests of the whole are in `main.rs` and `contracts.rs`.
