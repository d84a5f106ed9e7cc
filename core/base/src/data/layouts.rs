//! Responses to all scenarios of a study, concatenated.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::layout::Group;
use super::{Axis, Coordinates, Layout, Unit};

/// Name of the axis of scenarios.
pub const SCENARIO: &str = "scenario";

/// Layouts of the responses to all scenarios, concatenated as blocks; scenarios with equal axes share a block.
///
/// In a study with scenarios the first axis of every block is `scenario`. A study without scenarios has one block.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Layouts {
    /// The blocks, at least one; all have the same name and unit.
    pub blocks: Vec<Layout>,
}

impl From<Layout> for Layouts {
    fn from(layout: Layout) -> Self {
        Self { blocks: vec![layout] }
    }
}

impl Layouts {
    /// The blocks for the responses to named scenarios.
    pub fn of_scenarios<'a>(scenarios: impl IntoIterator<Item = (&'a str, Layout)>) -> Self {
        let mut blocks: Vec<(Vec<String>, Layout)> = Vec::new();
        for (name, layout) in scenarios {
            match blocks.iter_mut().find(|(_, other)| *other == layout) {
                Some((names, _)) => names.push(name.to_owned()),
                None => blocks.push((vec![name.to_owned()], layout)),
            }
        }
        let with_axis = |(names, mut layout): (Vec<String>, Layout)| {
            layout.axes.insert(0, Axis::labels(SCENARIO, names));
            layout
        };
        Self { blocks: blocks.into_iter().map(with_axis).collect() }
    }

    /// States the groups of scenarios: `group` is the group of a scenario, by its name, for a kind of group. A kind is left out of
    /// a block of which a scenario has no group of it.
    #[must_use]
    pub fn grouped<'a>(
        mut self,
        kinds: &[&str],
        group: impl Fn(&str, &str) -> Option<&'a str>,
    ) -> Self {
        for axis in self.blocks.iter_mut().filter_map(|block| block.axes.first_mut()) {
            let Coordinates::Labels(names) = &axis.coordinates else { continue };
            for kind in kinds {
                let of = |name: &String| group(name, kind).map(str::to_owned);
                if let Some(own) = names.iter().map(of).collect::<Option<Vec<String>>>() {
                    axis.groups.insert((*kind).to_owned(), own);
                }
            }
        }
        self
    }

    /// Name of the response.
    pub fn name(&self) -> &str {
        &self.blocks[0].name
    }

    /// Unit of the response's values.
    pub fn unit(&self) -> &Unit {
        &self.blocks[0].unit
    }

    /// Total number of outputs over all blocks.
    pub fn len(&self) -> usize {
        self.blocks.iter().map(Layout::len).sum()
    }

    /// Returns true if there are no outputs.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Range of flat output indices of each block.
    pub fn ranges(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let mut end = 0;
        self.blocks.iter().map(move |block| {
            let begin = end;
            end += block.len();
            begin..end
        })
    }

    /// Each block with its range of flat output indices.
    pub fn parts(&self) -> impl Iterator<Item = (&Layout, Range<usize>)> {
        self.blocks.iter().zip(self.ranges())
    }

    /// Layout of the response to one scenario (without the `scenario` axis), and its range of flat output indices.
    ///
    /// Without scenarios that is the first block, whatever the name; `None` if no block has the scenario.
    pub fn of_scenario(&self, name: &str) -> Option<(Layout, Range<usize>)> {
        self.parts().find_map(|(block, range)| {
            let Some(axis) = block.axes.first().filter(|axis| axis.name == SCENARIO) else {
                return Some((block.clone(), range));
            };
            let place = axis.position(name)?;
            let axes = block.axes[1..].to_vec();
            let length = block.len() / axis.len();
            let begin = range.start + place * length;
            Some((Layout { axes, ..block.clone() }, begin..begin + length))
        })
    }

    /// The block that contains a flat output index, and the index within that block.
    pub fn block(&self, flat: usize) -> (&Layout, usize) {
        let mut found = self.parts().filter(|(_, range)| range.contains(&flat));
        found.next().map_or((&self.blocks[0], flat), |(block, range)| (block, flat - range.start))
    }

    /// Description of one output, such as `sensor B, time 0.0001 s`.
    pub fn describe(&self, flat: usize) -> String {
        let (block, place) = self.block(flat);
        block.describe(place)
    }

    /// The groups of all blocks; indices are flat over all outputs.
    pub fn groups(&self) -> Vec<Group> {
        let shifted = |(block, range): (&Layout, Range<usize>)| {
            block.groups().into_iter().map(move |mut group| {
                group.indices.iter_mut().for_each(|i| *i += range.start);
                group
            })
        };
        self.parts().flat_map(shifted).collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn record(times: &[f64]) -> Layout {
        let axes = vec![Axis::grid("time", times.to_vec(), Unit::parse("s").unwrap())];
        Layout { name: "height".into(), unit: Unit::parse("m").unwrap(), axes }
    }

    #[test]
    fn scenarios_with_equal_axes_share_a_block() {
        let records = [
            ("a", record(&[0.0, 1.0])),
            ("b", record(&[0.0, 0.5, 1.0])),
            ("c", record(&[0.0, 1.0])),
        ];
        let layouts = Layouts::of_scenarios(records);
        assert_eq!(layouts.blocks.len(), 2);
        assert_eq!(layouts.len(), 7);
        assert_eq!(layouts.of_scenario("c").unwrap(), (record(&[0.0, 1.0]), 2..4));
        assert_eq!(layouts.of_scenario("b").unwrap().1, 4..7);
        assert_eq!(layouts.describe(5), "scenario `b`, time 0.5 s");
        let names: Vec<String> = layouts.groups().into_iter().map(|g| g.name).collect();
        assert_eq!(names, ["a", "c", "b"]);
        assert_eq!(layouts.groups()[1].indices, [2, 3]);
    }
}
