//! What a plugin is: one trait a kind, and the registry that finds them.

pub mod manual;
pub mod registry;
