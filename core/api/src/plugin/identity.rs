//! The identity of a plugin among the inputs of a stage.

use std::collections::BTreeMap;

use serde::Serialize;

/// The key that marks a plugin among the inputs of a stage; see [`Plugin`].
pub const MARK: &str = "plugin of a study";

/// A plugin among the inputs of a stage: its identity, which is hashed, and its revisions, which are only recorded.
#[derive(Debug, Serialize)]
pub struct Plugin<I> {
    /// Name, options and libraries: everything on which the results depend besides the code.
    #[serde(rename = "plugin of a study")]
    pub identity: I,
    /// Revisions of its code and of the plugins that it calls.
    pub revisions: BTreeMap<String, u32>,
}
