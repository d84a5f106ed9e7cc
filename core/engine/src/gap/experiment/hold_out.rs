//! Held-out data: chosen before the search, used by no fit.

use std::collections::BTreeMap;

use lacuna::data::layouts::SCENARIO;
use lacuna::data::{Coordinates, Layout, Measurements, Observations, Replicate};
use lacuna::math::random::{Stream, permutation};
use lacuna::plugin::effect::acts;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::blocks::held_out_blocks;
use crate::study::gap::HoldOut;

/// Smallest number of replicates of a condition at which one is held out.
const FEWEST: usize = 3;

/// Number of replicates of a condition that remain to estimate its noise.
const LEFT: usize = 2;

/// Measurements in two parts.
#[derive(Debug, Clone, PartialEq)]
pub struct HoldOutSplit {
    /// The data for calibration and search.
    pub training: Observations,
    /// The held-out data, by kind.
    pub held_out: Vec<HeldOutData>,
}

/// Held-out measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldOutData {
    /// The kind of the data.
    pub kind: HeldOutKind,
    /// Names, such as those of the replicates.
    pub names: Vec<String>,
    /// The values; each replicate is one unit of the comparison, independent of the others.
    pub data: Observations,
}

/// A kind of held-out data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HeldOutKind {
    /// Replicates under conditions that others were measured under too.
    Replicates,
    /// Whole scenarios.
    Scenarios,
    /// Whole curves, such as those of a sensor.
    Curves,
    /// Intervals of the last axis.
    Intervals,
    /// Blocks of curves without replicates.
    Blocks,
}

impl HeldOutKind {
    /// The plural of the kind in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Replicates => "replicates",
            Self::Scenarios => "scenarios",
            Self::Curves => "curves",
            Self::Intervals => "intervals",
            Self::Blocks => "blocks of curves",
        }
    }
}

/// Outputs of a replicate that are held out, by kind; one entry per output of the block.
struct Masks {
    scenarios: Vec<bool>,
    curves: Vec<bool>,
    intervals: Vec<bool>,
}

/// Splits data into those for the search and those that are held out, as `[gap] hold_out` of the study defines them;
/// `stream` draws the replicates.
pub fn split(data: &Observations, wish: &HoldOut, stream: &Stream) -> HoldOutSplit {
    let masks: Vec<Masks> = data.blocks.iter().map(|b| Masks::of(&b.layout, wish)).collect();
    let chosen: Vec<Vec<bool>> = data
        .blocks
        .iter()
        .enumerate()
        .map(|(b, block)| chosen(block, wish.replicates.get(), &stream.at(b as u64)))
        .collect();
    let kept = |b: usize, i: usize| masks[b].kind(i).is_none();
    let training = part(data, |b, r, _, i| !chosen[b][r] && kept(b, i));
    let seen = training.summaries();
    let mut held_out = Vec::new();
    let mut add = |kind: HeldOutKind, part: Observations| {
        if part.count() > 0 {
            let names = part.blocks.iter().flat_map(|b| &b.replicates).map(|r| r.name.clone());
            held_out.push(HeldOutData { kind, names: names.collect(), data: part });
        }
    };
    // Held-out values are kept only at outputs that a training replicate measured: elsewhere the noise is unknown.
    add(
        HeldOutKind::Replicates,
        part(data, |b, r, all, i| chosen[b][r] && kept(b, i) && seen[all].count > 0),
    );
    for kind in [HeldOutKind::Scenarios, HeldOutKind::Curves, HeldOutKind::Intervals] {
        add(kind, part(data, |b, _, _, i| masks[b].kind(i) == Some(kind)));
    }
    if held_out.is_empty() && wish.replicates.get() > 0.0 {
        return blocks(data, wish.replicates.get(), &stream.named("blocks"));
    }
    HoldOutSplit { training, held_out }
}

impl Masks {
    fn of(layout: &Layout, wish: &HoldOut) -> Self {
        let nothing = || vec![false; layout.len()];
        let scenarios = if wish.scenarios.is_empty() {
            nothing()
        } else {
            acts(layout, &BTreeMap::from([(SCENARIO.to_owned(), wish.scenarios.clone())]))
        };
        let curves = if wish.on.is_empty() { nothing() } else { acts(layout, &wish.on) };
        let grid = match layout.axes.last().map(|axis| &axis.coordinates) {
            Some(Coordinates::Grid { values, .. }) => values.as_slice(),
            _ => &[],
        };
        let inside = |x: &f64| wish.along.iter().any(|interval| interval.contains(*x));
        let intervals =
            (0..layout.len()).map(|i| !grid.is_empty() && inside(&grid[i % grid.len()]));
        Self { scenarios, curves, intervals: intervals.collect() }
    }

    /// The kind as which an output is held out; `None` if it is not.
    fn kind(&self, i: usize) -> Option<HeldOutKind> {
        if self.scenarios[i] {
            Some(HeldOutKind::Scenarios)
        } else if self.curves[i] {
            Some(HeldOutKind::Curves)
        } else {
            self.intervals[i].then_some(HeldOutKind::Intervals)
        }
    }
}

/// The wanted values; `wanted` receives block, replicate, output of all, and output of the block.
fn part(data: &Observations, wanted: impl Fn(usize, usize, usize, usize) -> bool) -> Observations {
    let mut begin = 0;
    let mut blocks = Vec::new();
    for (b, block) in data.blocks.iter().enumerate() {
        let mut replicates = Vec::new();
        for (r, replicate) in block.replicates.iter().enumerate() {
            let own = replicate.only(|i| wanted(b, r, begin + i, i));
            if own.values.iter().any(Option::is_some) {
                replicates.push(own);
            }
        }
        blocks.push(block.with_replicates(replicates));
        begin += block.layout.len();
    }
    Observations { blocks }
}

/// The held-out replicates of a block: a share of those with values under the same conditions.
fn chosen(block: &Measurements, share: f64, stream: &Stream) -> Vec<bool> {
    let mut groups: BTreeMap<Vec<bool>, Vec<usize>> = BTreeMap::new();
    for (r, replicate) in block.replicates.iter().enumerate() {
        groups.entry(conditions(&block.layout, replicate)).or_default().push(r);
    }
    let mut chosen = vec![false; block.replicates.len()];
    for (g, (_, members)) in groups.iter().enumerate() {
        let count = members.len();
        if count < FEWEST || share <= 0.0 {
            continue;
        }
        let held = ((share * count as f64).round() as usize).clamp(1, count - LEFT);
        let order = permutation(&mut stream.at(g as u64).generator(), count);
        order[..held].iter().for_each(|&k| chosen[members[k]] = true);
    }
    chosen
}

/// The scenarios of its block under which a replicate was measured.
fn conditions(layout: &Layout, replicate: &Replicate) -> Vec<bool> {
    let scenarios = match layout.axes.first().filter(|axis| axis.name == SCENARIO) {
        Some(axis) => axis.len(),
        None => 1,
    };
    let length = (layout.len() / scenarios.max(1)).max(1);
    replicate.values.chunks(length).map(|own| own.iter().any(Option::is_some)).collect()
}

/// Blocks inside each curve, the same for all its replicates, so that two replicates still show how they differ.
fn blocks(data: &Observations, share: f64, stream: &Stream) -> HoldOutSplit {
    let mut training = data.clone();
    let mut held_out: Vec<Measurements> =
        data.blocks.iter().map(|block| block.with_replicates(Vec::new())).collect();
    let mut drawn = 0;
    for (b, block) in data.blocks.iter().enumerate() {
        let length = match block.layout.axes.last().map(|axis| &axis.coordinates) {
            Some(Coordinates::Grid { values, .. }) => values.len(),
            _ => continue,
        };
        for begin in (0..block.layout.len()).step_by(length) {
            let is_measured = |i: &usize| block.replicates.iter().any(|r| r.values[*i].is_some());
            let measured: Vec<usize> = (begin..begin + length).filter(is_measured).collect();
            drawn += 1;
            for own in held_out_blocks(measured.len(), share, &stream.at(drawn)) {
                let place = block.layout.describe(measured[own.start]);
                for replicate in &mut training.blocks[b].replicates {
                    let aside = replicate.only(|i| measured[own.clone()].contains(&i));
                    measured[own.clone()].iter().for_each(|&i| replicate.values[i] = None);
                    if aside.values.iter().any(Option::is_some) {
                        let name = format!("{} from {place}", replicate.name);
                        held_out[b].replicates.push(Replicate { name, ..aside });
                    }
                }
            }
        }
    }
    let data = Observations { blocks: held_out };
    if data.count() == 0 {
        return HoldOutSplit { training, held_out: Vec::new() };
    }
    let names = data.blocks.iter().flat_map(|b| &b.replicates).map(|r| r.name.clone()).collect();
    HoldOutSplit {
        training,
        held_out: vec![HeldOutData { kind: HeldOutKind::Blocks, names, data }],
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lacuna::data::{Axis, Unit};
    use lacuna::plugin::effect::On;
    use lacuna::text::values::{Fraction, Interval};

    fn observations(replicates: usize, length: usize) -> Observations {
        let times = (0..length).map(|i| i as f64).collect();
        let axes = vec![
            Axis::labels("sensor", ["A", "B"]),
            Axis::grid("time", times, Unit::parse("s").unwrap()),
        ];
        let layout = Layout { name: "y".into(), unit: Unit::dimensionless(), axes };
        let replicate = |r: usize| {
            Replicate::new(
                r.to_string(),
                (0..2 * length).map(|i| Some((r * 1000 + i) as f64)).collect(),
            )
        };
        Measurements::new(layout, (0..replicates).map(replicate).collect()).into()
    }

    /// Every value is in exactly one part.
    fn assert_apart(data: &Observations, split: &HoldOutSplit) {
        let held: usize = split.held_out.iter().map(|part| part.data.count()).sum();
        assert_eq!(split.training.count() + held, data.count());
        let all = |data: &Observations| -> Vec<f64> {
            let replicates = data.blocks.iter().flat_map(|b| &b.replicates);
            replicates.flat_map(|r| r.values.iter().flatten().copied()).collect()
        };
        let mut found = all(&split.training);
        split.held_out.iter().for_each(|part| found.extend(all(&part.data)));
        let mut wanted = all(data);
        found.sort_by(f64::total_cmp);
        wanted.sort_by(f64::total_cmp);
        assert_eq!(found, wanted);
    }

    #[test]
    fn a_quarter_of_the_replicates_is_held_out() {
        for (count, held) in [(20, 5), (8, 2), (4, 1), (3, 1)] {
            let data = observations(count, 10);
            let split = split(&data, &HoldOut::default(), &Stream::root(1));
            assert_apart(&data, &split);
            assert_eq!(split.held_out[0].kind, HeldOutKind::Replicates);
            assert_eq!(split.held_out[0].names.len(), held);
        }
    }

    #[test]
    fn curves_and_intervals_are_held_out_from_all_replicates() {
        let data = observations(4, 10);
        let wish = HoldOut {
            replicates: Fraction::new(0.25).unwrap(),
            on: On::from([("sensor".to_owned(), vec!["B".to_owned()])]),
            along: vec![Interval::new(2.5, 4.0).unwrap()],
            ..HoldOut::default()
        };
        let split = split(&data, &wish, &Stream::root(1));
        assert_apart(&data, &split);
        let kinds: Vec<(HeldOutKind, usize)> =
            split.held_out.iter().map(|part| (part.kind, part.data.count())).collect();
        assert_eq!(
            kinds,
            [(HeldOutKind::Replicates, 8), (HeldOutKind::Curves, 40), (HeldOutKind::Intervals, 8)]
        );
    }

    #[test]
    fn blocks_stand_in_for_replicates() {
        let data = observations(1, 80);
        for seed in 0..20 {
            let split = split(&data, &HoldOut::default(), &Stream::root(seed));
            assert_apart(&data, &split);
            let part = &split.held_out[0];
            assert_eq!(
                (part.kind, part.names.len(), part.data.count()),
                (HeldOutKind::Blocks, 10, 40)
            );
        }
    }

    #[test]
    fn two_replicates_lack_the_same_blocks() {
        let data = observations(2, 80);
        let split = split(&data, &HoldOut::default(), &Stream::root(1));
        assert_apart(&data, &split);
        let lacks = |r: usize| -> Vec<bool> {
            split.training.blocks[0].replicates[r].values.iter().map(Option::is_none).collect()
        };
        assert_eq!(lacks(0), lacks(1));
        assert_eq!(split.held_out[0].names.len(), 20);
    }
}
