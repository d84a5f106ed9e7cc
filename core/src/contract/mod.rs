//! What every plugin of a kind must do, as suites that any plugin can be put through.
//!
//! A suite gives every breach it finds in words; it never panics.

mod sampler;

pub use sampler::sampler;
