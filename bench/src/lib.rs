//! What the benches share.

pub mod clock;
