//! Named columns of numbers.

use serde::{Deserialize, Serialize};

use super::Unit;

/// A column of a [`Table`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Column {
    /// Name of the column.
    pub name: String,
    /// Unit of the values; `None` if the source states none.
    pub unit: Option<Unit>,
    /// Values, one per row; NaN where the source has none.
    pub values: Vec<f64>,
}

/// Named columns of numbers, all of the same length.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// Columns, in the order of the source.
    pub columns: Vec<Column>,
}

impl Table {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |c| c.values.len())
    }

    /// The column with this name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|c| c.name == name)
    }
}
