//! Layout of a response: named axes with units.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::Unit;

/// Positions along an axis at which a response has values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Coordinates {
    /// Labels, such as names of sensors.
    Labels(Vec<String>),
    /// Increasing numbers with a unit, such as times.
    Grid {
        /// Grid points, strictly increasing.
        values: Vec<f64>,
        /// Unit of the grid points.
        unit: Unit,
    },
}

/// One named axis of a response.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// Name of the axis, such as `sensor` or `time`.
    pub name: String,
    /// Labels or grid of the axis.
    pub coordinates: Coordinates,
    /// Groups of the labels, by kind of group: the name of the group to which each label belongs, such as the target at which a
    /// scenario was measured.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub groups: BTreeMap<String, Vec<String>>,
}

impl Axis {
    /// An axis of labels.
    pub fn labels<S: Into<String>>(name: &str, labels: impl IntoIterator<Item = S>) -> Self {
        let labels = labels.into_iter().map(Into::into).collect();
        let coordinates = Coordinates::Labels(labels);
        Self { name: name.to_owned(), coordinates, groups: BTreeMap::new() }
    }

    /// An axis of increasing numbers with a unit.
    pub fn grid(name: &str, values: Vec<f64>, unit: Unit) -> Self {
        let coordinates = Coordinates::Grid { values, unit };
        Self { name: name.to_owned(), coordinates, groups: BTreeMap::new() }
    }

    /// Number of positions along the axis.
    pub fn len(&self) -> usize {
        match &self.coordinates {
            Coordinates::Labels(labels) => labels.len(),
            Coordinates::Grid { values, .. } => values.len(),
        }
    }

    /// Returns true if the axis has no positions.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Position `i` as text: the label, or the grid point without its unit.
    pub fn text(&self, i: usize) -> String {
        match &self.coordinates {
            Coordinates::Labels(labels) => labels[i].clone(),
            Coordinates::Grid { values, .. } => values[i].to_string(),
        }
    }

    /// Index of a label; `None` if the axis does not have it or is a grid.
    pub fn position(&self, label: &str) -> Option<usize> {
        match &self.coordinates {
            Coordinates::Labels(labels) => labels.iter().position(|l| l == label),
            Coordinates::Grid { .. } => None,
        }
    }
}

/// The shape of a response: its name, its unit and its axes.
///
/// A response is a flat slice in row-major order: the last axis varies fastest. With axes
/// `sensor` (10) and `time` (100) the value of sensor `s` at time `t` is entry `100 s + t`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Layout {
    /// Name of the response, such as `strain`.
    pub name: String,
    /// Unit of the response's values.
    pub unit: Unit,
    /// Axes, slowest-varying first; empty for a scalar response.
    pub axes: Vec<Axis>,
}

impl Layout {
    /// The layout of a dimensionless scalar.
    pub fn number(name: &str) -> Self {
        Self { name: name.to_owned(), unit: Unit::dimensionless(), axes: Vec::new() }
    }

    /// Number of values of a response: the product of the axis lengths, 1 without axes.
    pub fn len(&self) -> usize {
        self.axes.iter().map(Axis::len).product()
    }

    /// Returns true if a response has no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Lengths of the axes.
    pub fn shape(&self) -> Vec<usize> {
        self.axes.iter().map(Axis::len).collect()
    }

    /// Flat index of the value at the given index along each axis.
    pub fn index(&self, place: &[usize]) -> usize {
        debug_assert_eq!(place.len(), self.axes.len());
        self.axes.iter().zip(place).fold(0, |flat, (axis, &i)| flat * axis.len() + i)
    }

    /// Index along each axis of the value at a flat index.
    pub fn place(&self, flat: usize) -> Vec<usize> {
        let mut rest = flat;
        let mut place = vec![0; self.axes.len()];
        for (i, axis) in self.axes.iter().enumerate().rev() {
            place[i] = rest % axis.len();
            rest /= axis.len();
        }
        place
    }

    /// Position of the axis with this name in `axes`, and the axis.
    pub fn axis(&self, name: &str) -> Option<(usize, &Axis)> {
        self.axes.iter().enumerate().find(|(_, axis)| axis.name == name)
    }

    /// Description of the value at a flat index, such as `sensor B, time 0.0001 s`.
    pub fn describe(&self, flat: usize) -> String {
        let place = self.place(flat);
        let words = self.axes.iter().zip(place).map(|(axis, i)| match &axis.coordinates {
            Coordinates::Labels(labels) => format!("{} `{}`", axis.name, labels[i]),
            Coordinates::Grid { values, unit } => format!("{} {} {unit}", axis.name, values[i]),
        });
        words.collect::<Vec<_>>().join(", ")
    }

    /// The groups that figures and tables show separately: one per combination of labels, with the flat indices of its
    /// values in order.
    ///
    /// For `sensor x time` the groups are the sensors; without a label axis there is one group, named after the
    /// response.
    pub fn groups(&self) -> Vec<Group> {
        let is_label = |axis: &Axis| matches!(axis.coordinates, Coordinates::Labels(_));
        let mut groups: Vec<Group> = Vec::new();
        for flat in 0..self.len() {
            let place = self.place(flat);
            let labels: Vec<String> = self
                .axes
                .iter()
                .zip(&place)
                .filter(|(axis, _)| is_label(axis))
                .map(|(axis, &i)| axis.text(i))
                .collect();
            let name = if labels.is_empty() { self.name.clone() } else { labels.join(" ") };
            match groups.iter_mut().find(|g| g.name == name) {
                Some(group) => group.indices.push(flat),
                None => groups.push(Group { name, indices: vec![flat] }),
            }
        }
        groups
    }

    /// Name, grid and unit of the last numeric axis (usually time), the abscissa of curves.
    pub fn abscissa(&self) -> Option<(&str, &[f64], &Unit)> {
        self.axes.iter().rev().find_map(|axis| match &axis.coordinates {
            Coordinates::Grid { values, unit } => Some((axis.name.as_str(), &values[..], unit)),
            Coordinates::Labels(_) => None,
        })
    }
}

/// One curve of a response, such as one sensor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// Labels of the group, joined.
    pub name: String,
    /// Flat indices of the curve's values, in order.
    pub indices: Vec<usize>,
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn strain() -> Layout {
        Layout {
            name: "strain".into(),
            unit: Unit::parse("1").unwrap(),
            axes: vec![
                Axis::labels("sensor", ["B", "C"]),
                Axis::grid("time", vec![1e-5, 2e-5, 3e-5], Unit::parse("s").unwrap()),
            ],
        }
    }

    #[test]
    fn flat_indices_and_places_are_inverse() {
        let layout = strain();
        assert_eq!(layout.len(), 6);
        for flat in 0..6 {
            assert_eq!(layout.index(&layout.place(flat)), flat);
        }
        assert_eq!(layout.place(4), [1, 1]);
        assert_eq!(layout.describe(4), "sensor `C`, time 0.00002 s");
    }

    #[test]
    fn groups_are_the_labels_with_their_curves() {
        let groups = strain().groups();
        assert_eq!(groups.len(), 2);
        assert_eq!((groups[1].name.as_str(), &groups[1].indices[..]), ("C", &[3, 4, 5][..]));
    }
}
