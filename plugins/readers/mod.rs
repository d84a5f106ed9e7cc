//! Readers: files in, data with names, units and axes out.

pub mod error;
pub mod sierra;

pub use error::ReadError;
