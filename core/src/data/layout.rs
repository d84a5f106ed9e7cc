//! Named axes with units: what a response looks like.

use serde::{Deserialize, Serialize};

use super::Unit;

/// Where along an axis the values of a response lie.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Coordinates {
    /// Names, such as those of sensors.
    Labels(Vec<String>),
    /// Increasing numbers in a unit, such as times.
    Grid {
        /// The numbers, increasing.
        values: Vec<f64>,
        /// Their unit.
        unit: Unit,
    },
}

/// One named axis of a response.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// The axis' name, such as `sensor` or `time`.
    pub name: String,
    /// Its labels or its grid.
    pub coordinates: Coordinates,
}

impl Axis {
    /// An axis of names.
    pub fn labels<S: Into<String>>(name: &str, labels: impl IntoIterator<Item = S>) -> Self {
        let labels = labels.into_iter().map(Into::into).collect();
        Self { name: name.to_owned(), coordinates: Coordinates::Labels(labels) }
    }

    /// An axis of increasing numbers in a unit.
    pub fn grid(name: &str, values: Vec<f64>, unit: Unit) -> Self {
        Self { name: name.to_owned(), coordinates: Coordinates::Grid { values, unit } }
    }

    /// The number of places along the axis.
    pub fn len(&self) -> usize {
        match &self.coordinates {
            Coordinates::Labels(labels) => labels.len(),
            Coordinates::Grid { values, .. } => values.len(),
        }
    }

    /// Whether the axis has no places.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Place `i` as text: the label, or the number without its unit.
    pub fn text(&self, i: usize) -> String {
        match &self.coordinates {
            Coordinates::Labels(labels) => labels[i].clone(),
            Coordinates::Grid { values, .. } => values[i].to_string(),
        }
    }

    /// The index of a label, if the axis has it.
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
    /// The response's name, such as `strain`.
    pub name: String,
    /// The unit of its values.
    pub unit: Unit,
    /// Its axes, slowest first; none for a scalar response.
    pub axes: Vec<Axis>,
}

impl Layout {
    /// A single number without a unit.
    pub fn number(name: &str) -> Self {
        Self { name: name.to_owned(), unit: Unit::dimensionless(), axes: Vec::new() }
    }

    /// The number of values of a response (1 without axes).
    pub fn len(&self) -> usize {
        self.axes.iter().map(Axis::len).product()
    }

    /// Whether a response has no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The lengths of the axes.
    pub fn shape(&self) -> Vec<usize> {
        self.axes.iter().map(Axis::len).collect()
    }

    /// The flat index of a place given one index an axis.
    pub fn index(&self, place: &[usize]) -> usize {
        debug_assert_eq!(place.len(), self.axes.len());
        self.axes.iter().zip(place).fold(0, |flat, (axis, &i)| flat * axis.len() + i)
    }

    /// The index along each axis of a flat index.
    pub fn place(&self, flat: usize) -> Vec<usize> {
        let mut rest = flat;
        let mut place = vec![0; self.axes.len()];
        for (i, axis) in self.axes.iter().enumerate().rev() {
            place[i] = rest % axis.len();
            rest /= axis.len();
        }
        place
    }

    /// The position and the axis of this name.
    pub fn axis(&self, name: &str) -> Option<(usize, &Axis)> {
        self.axes.iter().enumerate().find(|(_, axis)| axis.name == name)
    }

    /// A place in words, such as `sensor B, time 0.0001 s`.
    pub fn describe(&self, flat: usize) -> String {
        let place = self.place(flat);
        let words = self.axes.iter().zip(place).map(|(axis, i)| match &axis.coordinates {
            Coordinates::Labels(labels) => format!("{} `{}`", axis.name, labels[i]),
            Coordinates::Grid { values, unit } => format!("{} {} {unit}", axis.name, values[i]),
        });
        words.collect::<Vec<_>>().join(", ")
    }

    /// The groups that figures and tables show one by one: the places of all label axes together,
    /// each with the flat indices that belong to it, in order.
    ///
    /// For `sensor x time` the groups are the sensors; without a label axis there is one group, named
    /// after the response.
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

    /// The grid of the last numeric axis (usually time), against which curves are drawn.
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
    /// The labels that name it.
    pub name: String,
    /// The flat indices of its values, in order.
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
