//! `[gap]`: how a search for missing effects works, and what it tries.

mod edit;
mod held;
mod inside;
mod swap;
mod text;

use std::collections::BTreeMap;

pub use edit::{Added, Edit, Swapped};
pub use held::Held;
pub(super) use held::Loose;
pub use inside::{Inside, Swap, SwapKeys, SwitchSection, TermKeys};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::decode::decode_beside;
use super::values::{Count, Fraction, Interval, Name, OpenFraction};
use super::{Node, Problems};
use crate::plugin::Effect;
use crate::plugin::effect::On;
use crate::plugin::registry::{Section, section};

/// How a search for missing effects (`lacuna gap STUDY`) works.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GapSection {
    /// The probability of an alarm when nothing is missing: three fifths of it for effects that get a name, two fifths
    /// for gaps without one.
    pub false_alarm: OpenFraction,
    /// The most effects that are added.
    pub effects: Count,
    /// How many data without any missing effect are simulated to know what the tests make of them.
    pub simulations: Count,
    /// The effects that are tried, by the names of their plugins (`lacuna plugins effect`), each with priors that it
    /// proposes for the data; all that are installed when left out. `[[gap.candidate]]` adds others. In a study whose model
    /// is written as equations and that has no surrogate, terms too (`lacuna plugins term`): each wherever the
    /// equations have a place for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub candidates: Option<Vec<String>>,
    /// Whether terms are tried that nobody names.
    pub terms: bool,
    /// What is set aside before anything is looked at, to show whether the gap shrank.
    pub hold_out: HoldOut,
}

impl Default for GapSection {
    fn default() -> Self {
        let count = |n| Count::new(n).unwrap_or_else(|_| unreachable!("{n} is a count"));
        let level = OpenFraction::new(0.05).unwrap_or_else(|_| unreachable!("0.05 is inside"));
        Self {
            false_alarm: level,
            effects: count(3),
            simulations: count(399),
            candidates: None,
            terms: true,
            hold_out: HoldOut::default(),
        }
    }
}

/// What is set aside.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HoldOut {
    /// The share of the replicates of each condition, chosen by the study's seed: at least one of three or more, and at
    /// most all but two. Where no condition has three replicates and nothing else is set aside, the same share of up to
    /// 24 blocks of each curve stands in for them, at most every third block.
    pub replicates: Fraction,
    /// Whole scenarios.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub scenarios: Vec<String>,
    /// Whole curves by their labels, such as `{ sensor = ["B"] }`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub on: On,
    /// Intervals of the last axis of every curve, such as `[[0.004, 0.005]]`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub along: Vec<Interval>,
}

impl Default for HoldOut {
    fn default() -> Self {
        let quarter = Fraction::new(0.25).unwrap_or_else(|_| unreachable!("a quarter"));
        Self { replicates: quarter, scenarios: Vec::new(), on: On::new(), along: Vec::new() }
    }
}

/// The engine's keys of `[[gap.candidate]]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct CandidateKeys {
    /// What it is called when it is found; the name of its plugin when left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<Name>,
}

/// `[gap]` with its lists.
#[derive(Default)]
pub struct Gap {
    /// The section's own keys.
    pub keys: GapSection,
    /// `[[gap.candidate]]`: effects that are tried with the options given.
    pub candidates: Vec<Section<dyn Effect, CandidateKeys>>,
    /// `[[gap.switch]]`, `[[gap.term]]`, `[[gap.model]]`: pieces that may be missing inside the model.
    pub inside: Inside,
}

/// The lists of `[gap]`.
const LISTS: [&str; 4] = ["candidate", "switch", "term", "model"];

/// `[gap]`; the defaults where it is not written.
pub(super) fn gap(root: &Node, problems: &mut Problems) -> Option<Gap> {
    let Some(node) = root.get("gap") else { return Some(Gap::default()) };
    problems.within("gap", |problems| {
        let mut own = node.clone();
        for list in LISTS {
            own.remove(list);
        }
        let keys = decode_beside(&own, &LISTS, problems);
        let list = node.get("candidate").map(Node::elements).unwrap_or_default();
        let candidates: Vec<Option<_>> = list
            .iter()
            .map(|node| problems.within("candidate", |problems| section(node, None, problems)))
            .collect();
        let inside = Inside::of(node, problems);
        let candidates = candidates.into_iter().collect::<Option<_>>();
        Some(Gap { keys: keys?, candidates: candidates?, inside: inside? })
    })
}
