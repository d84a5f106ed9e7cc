//! An axis of labels as written: the labels, and their positions on a line.

use std::collections::{HashMap, HashSet};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::node::quoted;
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
        let mut known = HashMap::new();
        for (label, x) in &placed {
            if !x.is_finite() {
                return Err(format!("expected a finite position of `{label}`, found {x}"));
            }
            if let Some(other) = known.insert(place(*x), *label) {
                return Err(format!(
                    "expected different positions, found {x} for both `{other}` and `{label}`"
                ));
            }
        }
        Ok(placed)
    }
}

/// The bits of a position, which are equal for equal positions.
pub fn place(x: f64) -> u64 {
    // Both zeros become the positive one.
    (x + 0.0).to_bits()
}

/// Largest length of a label, in bytes: labels become names of files and of what is in them, with something added.
const MOST: usize = 200;

/// Checks that a label can be written into every file of results.
///
/// # Errors
/// A description of what is wrong with it.
pub fn check(label: &str) -> Result<(), String> {
    if label.contains(|c: char| c.is_ascii_control()) {
        return Err(format!(
            "expected a label without control characters such as line ends, found {}",
            quoted(label)
        ));
    }
    if label.len() > MOST {
        let (length, shown) = (label.len(), quoted(label));
        return Err(format!("expected a label of at most {MOST} bytes, found {length}: {shown}"));
    }
    Ok(())
}

/// An axis of these labels.
///
/// # Errors
/// A description of what is wrong with them.
pub(super) fn axis(name: &str, labels: &[String]) -> Result<Axis, String> {
    if labels.is_empty() {
        return Err("expected at least one label, found none".to_owned());
    }
    let mut known = HashSet::new();
    for label in labels {
        check(label)?;
        if !known.insert(label) {
            return Err(format!("expected different labels, found `{label}` twice"));
        }
    }
    Ok(Axis::labels(name, labels.iter().cloned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(labels: &[&str]) -> String {
        let labels: Vec<String> = labels.iter().map(ToString::to_string).collect();
        axis("sensor", &labels).unwrap_err()
    }

    #[test]
    fn labels_that_no_file_can_hold_are_refused() {
        assert_eq!(refused(&["a", "b", "a"]), "expected different labels, found `a` twice");
        for bad in ["a\0b", "a\nb", "\u{1f}", "\u{7f}"] {
            let right = format!(
                "expected a label without control characters such as line ends, found {bad:?}"
            );
            assert_eq!(refused(&["a", bad]), right);
        }
        let long = "µ".repeat(101);
        let right =
            format!("expected a label of at most 200 bytes, found 202: \"{}…\"", "µ".repeat(40));
        assert_eq!(refused(&[&long]), right);
        let plain = ["°C 90 %", &"µ".repeat(100)].map(str::to_owned);
        assert!(axis("sensor", &plain).is_ok());
    }

    #[test]
    fn positions_are_different_in_number_and_not_in_sign_of_zero() {
        let section = |positions: &[f64]| LabelSection {
            labels: (0..positions.len()).map(|i| i.to_string()).collect(),
            positions: Some(positions.to_vec()),
            unit: metre(),
        };
        assert_eq!(section(&[0.5, -0.5]).placed(), Ok(vec![("0", 0.5), ("1", -0.5)]));
        let right = "expected different positions, found -0 for both `0` and `2`".to_owned();
        assert_eq!(section(&[0.0, 1.0, -0.0]).placed(), Err(right));
    }

    #[test]
    fn many_labels_are_compared_at_once() {
        let labels: Vec<String> = (0..200_000).map(|i| i.to_string()).collect();
        let positions = Some((0..200_000).map(f64::from).collect());
        assert_eq!(axis("sensor", &labels).unwrap().len(), 200_000);
        let section = LabelSection { labels, positions, unit: metre() };
        assert_eq!(section.placed().unwrap().len(), 200_000);
    }
}
