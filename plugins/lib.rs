//! The components a Lacuna study can name.

pub mod models;
