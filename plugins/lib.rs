//! The components a Lacuna study can name: one folder a kind, one file a plugin.

pub mod readers;
