//! Groups of outputs with a common number.

use std::fmt;

use lacuna::data::{Axis, Coordinates, Layout};
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::{Deserialize, Deserializer, Serialize, de};

/// Groups of outputs with a common number: `"all"`, an axis such as `"sensor"` (one group per value), windows of an
/// axis, or a list of these (one group per combination).
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum By {
    /// Single division: `"all"`, the name of an axis, or windows.
    One(Division),
    /// Combination of divisions, such as `["sensor", { axis = "time", windows = 5 }]`.
    Many(Vec<Division>),
}

/// Division of the outputs along one axis.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Division {
    /// One group for each value of this axis, or for each group of scenarios: with `"target"` one for each target that the labels
    /// of the scenarios name.
    Axis(String),
    /// Windows of a numeric axis, such as `{ axis = "time", windows = 5 }` or
    /// `{ axis = "time", edges = [2e-4, 5e-4] }`.
    Windows(AxisWindows),
}

/// Windows of a numeric axis: their number, or the edges between them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AxisWindows {
    /// Name of the axis.
    pub axis: String,
    /// Number of windows, which hold numbers of grid values as equal as possible.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub windows: Option<usize>,
    /// Edges between windows, increasing, in the unit of the axis. A value on an edge belongs to the window after it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edges: Option<Vec<f64>>,
}

impl Default for By {
    fn default() -> Self {
        Self::One(Division::Axis("all".to_owned()))
    }
}

impl By {
    /// Returns the division with one group for each value of this axis.
    pub fn axis(name: &str) -> Self {
        Self::One(Division::Axis(name.to_owned()))
    }

    /// Returns true if the outputs are divided along this axis.
    pub fn divides(&self, axis: &str) -> bool {
        self.divisions().iter().any(|division| division.axis() == axis)
    }

    fn divisions(&self) -> &[Division] {
        match self {
            Self::One(Division::Axis(name)) if name == "all" => &[],
            Self::One(division) => std::slice::from_ref(division),
            Self::Many(divisions) => divisions,
        }
    }

    /// Reports axes that the response does not have, and invalid windows.
    pub fn check(&self, at: &str, layout: &Layout, complaints: &mut Complaints<'_>) {
        for division in self.divisions() {
            if let Err(text) = division.classes(layout) {
                complaints.at(at).say(text);
            }
        }
    }
}

impl Division {
    fn axis(&self) -> &str {
        match self {
            Self::Axis(name) => name,
            Self::Windows(windows) => &windows.axis,
        }
    }

    /// Returns the position of the axis, the class of each of its values, and the names of the classes.
    fn classes(&self, layout: &Layout) -> Result<(usize, Vec<usize>, Vec<String>), String> {
        let Some((position, axis)) = layout.axis(self.axis()) else {
            let by_labels =
                of_labels(layout, self.axis()).filter(|_| matches!(self, Self::Axis(_)));
            if let Some(found) = by_labels {
                return Ok(by_label(found));
            }
            let names: Vec<String> = layout.axes.iter().map(|a| format!("`{}`", a.name)).collect();
            let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            return Err(format!("the response has no axis `{}`; it has {known}", self.axis()));
        };
        let (of, names) = match self {
            Self::Axis(_) => {
                ((0..axis.len()).collect(), (0..axis.len()).map(|i| word(axis, i, i)).collect())
            }
            Self::Windows(windows) => windows.classes(axis)?,
        };
        Ok((position, of, names))
    }
}

/// The axis whose labels belong to groups of this kind, and the group of each.
fn of_labels<'a>(layout: &'a Layout, kind: &str) -> Option<(usize, &'a [String])> {
    let mut axes = layout.axes.iter().enumerate();
    axes.find_map(|(position, axis)| Some((position, axis.groups.get(kind)?.as_slice())))
}

/// The classes of labels by their groups, in the order of the labels.
fn by_label((position, groups): (usize, &[String])) -> (usize, Vec<usize>, Vec<String>) {
    let mut names: Vec<String> = Vec::new();
    let mut of = Vec::new();
    for group in groups {
        let known = names.iter().position(|name| name == group);
        of.push(known.unwrap_or_else(|| {
            names.push(group.clone());
            names.len() - 1
        }));
    }
    (position, of, names)
}

impl AxisWindows {
    fn classes(&self, axis: &Axis) -> Result<(Vec<usize>, Vec<String>), String> {
        let Coordinates::Grid { values, .. } = &axis.coordinates else {
            return Err(format!("axis `{}` has labels; windows need numbers", axis.name));
        };
        let raw: Vec<usize> = match (self.windows, &self.edges) {
            (Some(count), None) if (1..=values.len()).contains(&count) => {
                (0..values.len()).map(|i| i * count / values.len()).collect()
            }
            (Some(count), None) => {
                let most = values.len();
                return Err(format!(
                    "expected 1 to {most} windows of axis `{}`, found {count}",
                    axis.name
                ));
            }
            (None, Some(edges)) if edges.windows(2).all(|e| e[0] < e[1]) => {
                values.iter().map(|v| edges.partition_point(|e| e <= v)).collect()
            }
            (None, Some(_)) => return Err("the edges of windows must increase".to_owned()),
            _ => return Err("expected either `windows` or `edges`".to_owned()),
        };
        // Windows without a grid value are dropped.
        let mut kept = raw.clone();
        kept.dedup();
        let of: Vec<usize> = raw.iter().map(|w| kept.partition_point(|k| k < w)).collect();
        let ends = |w: usize| {
            let first = of.partition_point(|&k| k < w);
            (first, of.partition_point(|&k| k <= w) - 1)
        };
        let names = (0..kept.len()).map(|w| word(axis, ends(w).0, ends(w).1)).collect();
        Ok((of, names))
    }
}

/// Names the values `first` to `last` of an axis: a label, a number, or a range of numbers, with the unit.
fn word(axis: &Axis, first: usize, last: usize) -> String {
    let unit = match &axis.coordinates {
        Coordinates::Grid { unit, .. } if !unit.is_dimensionless() => format!(" {unit}"),
        _ => String::new(),
    };
    if first == last {
        return format!("{}{unit}", axis.text(first));
    }
    format!("{}..{}{unit}", axis.text(first), axis.text(last))
}

/// Assignment of the outputs to groups.
#[derive(Debug, Clone, PartialEq)]
pub struct Groups {
    /// Name of each group; empty if there is only one.
    pub names: Vec<String>,
    /// Group of each output; `None` if the group was never measured.
    pub of: Vec<Option<usize>>,
    /// Index of each group among all groups of the layout.
    pub position: Vec<usize>,
}

impl Groups {
    /// Returns the groups of a layout, in the order of the outputs; fails if an axis is missing.
    pub fn of(layout: &Layout, by: &By) -> Result<Self, String> {
        let divisions: Vec<_> =
            by.divisions().iter().map(|d| d.classes(layout)).collect::<Result<_, _>>()?;
        let class = |i: usize| -> Vec<usize> {
            let place = layout.place(i);
            divisions.iter().map(|(axis, of, _)| of[place[*axis]]).collect()
        };
        let of: Vec<Vec<usize>> = (0..layout.len()).map(class).collect();
        let mut found = of.clone();
        found.sort();
        found.dedup();
        let name = |class: &Vec<usize>| {
            let words = class.iter().zip(&divisions).map(|(&c, (_, _, names))| names[c].as_str());
            words.collect::<Vec<_>>().join(", ")
        };
        Ok(Self {
            names: found.iter().map(name).collect(),
            of: of.iter().map(|c| Some(found.partition_point(|f| f < c))).collect(),
            position: (0..found.len()).collect(),
        })
    }

    /// Returns the groups without those that hold none of these outputs.
    pub fn with_data(&self, measured: &[usize]) -> Self {
        let mut kept: Vec<usize> = measured.iter().filter_map(|&i| self.of[i]).collect();
        kept.sort_unstable();
        kept.dedup();
        Self {
            names: kept.iter().map(|&g| self.names[g].clone()).collect(),
            of: self.of.iter().map(|g| kept.binary_search(&(*g)?).ok()).collect(),
            position: kept.iter().map(|&g| self.position[g]).collect(),
        }
    }

    /// Returns the number of groups.
    pub fn count(&self) -> usize {
        self.names.len()
    }

    /// Returns the name of the number `base` of a group, such as `variance[B]`.
    pub fn name(&self, base: &str, group: usize) -> String {
        match self.names[group].as_str() {
            "" => base.to_owned(),
            name => format!("{base}[{name}]"),
        }
    }

    /// Returns for each output the number of its group; the mean of all groups if its group was never measured.
    pub fn spread(&self, values: &[f64]) -> Vec<f64> {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let of = |g: usize| values.get(g).copied().unwrap_or(f64::NAN);
        self.of.iter().map(|g| g.map_or(mean, of)).collect()
    }

    /// Returns the sums over the groups of numbers that belong to these outputs.
    pub fn sums(&self, outputs: &[usize], values: impl IntoIterator<Item = f64>) -> Vec<f64> {
        let mut sums = vec![0.0; self.count()];
        for (&i, value) in outputs.iter().zip(values) {
            if let Some(g) = self.of[i] {
                sums[g] += value;
            }
        }
        sums
    }
}

impl<'de> Deserialize<'de> for By {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Visitor { list: true })
    }
}

impl<'de> Deserialize<'de> for Division {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match deserializer.deserialize_any(Visitor { list: false })? {
            By::One(division) => Ok(division),
            By::Many(_) => Err(de::Error::custom("a list in a list")),
        }
    }
}

/// Deserialises a [`By`] by the type of the value, so that errors inside keep their own position and message.
struct Visitor {
    list: bool,
}

impl<'de> de::Visitor<'de> for Visitor {
    type Value = By;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of an axis, windows such as `{ axis = \"time\", windows = 5 }`")?;
        f.write_str(if self.list { ", or a list of these" } else { "" })
    }

    fn visit_str<E: de::Error>(self, name: &str) -> Result<By, E> {
        String::deserialize(StrDeserializer::new(name)).map(|name| By::One(Division::Axis(name)))
    }

    fn visit_map<A: de::MapAccess<'de>>(self, map: A) -> Result<By, A::Error> {
        let windows = AxisWindows::deserialize(MapAccessDeserializer::new(map))?;
        Ok(By::One(Division::Windows(windows)))
    }

    fn visit_seq<A: de::SeqAccess<'de>>(self, mut items: A) -> Result<By, A::Error> {
        if !self.list {
            return Err(de::Error::invalid_type(de::Unexpected::Seq, &self));
        }
        let mut divisions = Vec::new();
        while let Some(division) = items.next_element()? {
            divisions.push(division);
        }
        Ok(By::Many(divisions))
    }
}
