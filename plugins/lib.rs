//! The components a study can name: one folder a kind, one file (or folder) a plugin.

pub mod surrogates;
