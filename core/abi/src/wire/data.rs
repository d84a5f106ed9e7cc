//! Measurements without their values.

use lacuna::data::Layout;
use serde::{Deserialize, Serialize};

/// The shape of a complete measurement and the names of the replicates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DataAbout {
    /// The shape.
    pub layout: Layout,
    /// The names, in order.
    pub replicates: Vec<String>,
}
