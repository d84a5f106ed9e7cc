//! An axis of labels as written: the labels, and their positions on a line.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::data::{Axis, Unit};

/// An axis of labels with their positions on a line, such as the places of sensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LabelSection {
    /// Labels, such as the names of sensors.
    pub labels: Vec<String>,
    /// Position of each label on a line, in `unit`, in the order of `labels`. Effects that act between places, such as
    /// `misplacement`, are tried only along an axis with positions. Default: unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub positions: Option<Vec<f64>>,
    /// Unit of the positions.
    #[serde(default = "metre")]
    pub unit: Unit,
}

/// The unit of positions that have none.
pub(super) fn metre() -> Unit {
    Unit::parse("m").unwrap_or_default()
}

impl LabelSection {
    /// Each label with its position; empty if the positions are unknown.
    ///
    /// # Errors
    /// A description of what is wrong with the positions.
    pub fn placed(&self) -> Result<Vec<(&str, f64)>, String> {
        let Some(positions) = &self.positions else { return Ok(Vec::new()) };
        let [labels, given] = [self.labels.len(), positions.len()];
        if labels != given {
            return Err(format!(
                "expected one position for each of {labels} labels, found {given}"
            ));
        }
        let placed = self.labels.iter().map(String::as_str).zip(positions.iter().copied());
        let placed: Vec<(&str, f64)> = placed.collect();
        for (i, (label, x)) in placed.iter().enumerate() {
            if !x.is_finite() {
                return Err(format!("expected a finite position of `{label}`, found {x}"));
            }
            if let Some((other, _)) = placed[..i].iter().find(|(_, other)| other == x) {
                return Err(format!(
                    "expected different positions, found {x} for both `{other}` and `{label}`"
                ));
            }
        }
        Ok(placed)
    }
}

/// An axis of these labels.
///
/// # Errors
/// A description of what is wrong with them.
pub(super) fn axis(name: &str, labels: &[String]) -> Result<Axis, String> {
    if labels.is_empty() {
        return Err("expected at least one label, found none".to_owned());
    }
    match labels.iter().enumerate().find(|(i, label)| labels[..*i].contains(label)) {
        Some((_, twice)) => Err(format!("expected different labels, found `{twice}` twice")),
        None => Ok(Axis::labels(name, labels.iter().cloned())),
    }
}
