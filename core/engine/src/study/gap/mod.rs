//! `[gap]`: settings and candidates of the search for missing effects.

pub mod added;
pub mod companion;
mod held;
mod inside;
pub mod next;
mod runs;

use std::collections::BTreeMap;

use lacuna::plugin::effect::On;
use lacuna::plugin::registry::{Section, section};
use lacuna::plugin::{Effect, Reader};
use lacuna::text::decode::decode_beside;
use lacuna::text::values::{Count, Fraction, Interval, Name, OpenFraction, Positive};
use lacuna::text::{Node, Problems};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use added::Added;
pub use added::AddedCandidate;
pub use companion::Companion;
pub use held::Held;
pub(super) use held::{Loose, hold};
pub use inside::{Inside, Swap, SwapKeys, SwitchPlace, SwitchSection, TermKeys};
use next::{NextKeys, QuantityKeys};
pub use runs::RunsKeys;

/// Settings of the search for missing effects (`lacuna gap STUDY`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GapSection {
    /// False-alarm rate: the probability that the search reports a gap when nothing is missing. Three fifths of it are
    /// spent on the tests of named effects, two fifths on the tests for gaps without a name.
    pub false_alarm: OpenFraction,
    /// Maximum number of effects added to the model.
    pub effects: Count,
    /// Number of data sets simulated under the hypothesis that nothing is missing, from which the null distributions of
    /// the tests are estimated. The smallest possible p-value is 1 / (simulations + 1).
    pub simulations: Count,
    /// Candidate effects, by the names of their plugins (`lacuna plugins effect`); each proposes priors suited to the
    /// data. `[[gap.candidate]]` adds others. In a study without a surrogate whose model is written as equations, terms
    /// may be named too (`lacuna plugins term`); each is tried at every place that the equations have for it. Default:
    /// all installed effects and, in such a study, all terms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub candidates: Option<Vec<String>>,
    /// `true` also tries the library's terms that the study does not name, if the study has no surrogate and its model
    /// is written as equations; `false` restricts terms to those of `[[gap.term]]`.
    pub terms: bool,
    /// `true` seeks the law of what the equations lack where no candidate has a name, if the study has no surrogate and its
    /// model is written as equations: a further force in each rate is inferred over time, and described as a function of
    /// the states. `false` does not.
    pub laws: bool,
    /// Prior odds of physics inside the model (`[[gap.switch]]`, terms, `[gap.companion]`, `[[gap.runs]]`) against effects on
    /// the response, such as `{ inside = 1, response = 1 }`, the default. The types of each share its probability equally.
    pub prior_odds: PriorOdds,
    /// Data held out before the search, on which it is measured whether the gap became smaller.
    pub hold_out: HoldOut,
    /// Names of the `[[gap.runs]]` whose physics is part of the study: its change is added to every response, and its size
    /// is calibrated. Default: none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub add: Vec<Name>,
    /// Data that could be taken next. Default: one and four further replicates of everything, of each scenario and of each
    /// sensor, measured so far or not.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub next: Vec<NextKeys>,
    /// Quantity of the response that the next data should tell. Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantity: Option<QuantityKeys>,
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
            laws: true,
            prior_odds: PriorOdds::default(),
            hold_out: HoldOut::default(),
            add: Vec::new(),
            next: Vec::new(),
            quantity: None,
        }
    }
}

/// Prior odds of the two groups of candidates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PriorOdds {
    /// Odds of physics inside the model: inputs that are set free, and terms of the equations. Default: 1 if some curve has
    /// replicates, 4 if none has.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inside: Option<Positive>,
    /// Odds of effects on the response: sensors, and what the library describes there.
    pub response: Positive,
}

impl Default for PriorOdds {
    fn default() -> Self {
        let one = Positive::new(1.0).unwrap_or_else(|_| unreachable!("1 is positive"));
        Self { inside: None, response: one }
    }
}

impl PriorOdds {
    /// The odds of physics inside the model in measurements with replicates or without.
    ///
    /// What a single instrument recorded once lacks physics more often than the instrument is at fault in a way that
    /// depends on the response: all seven records with a known missing effect of other people's that the project has were
    /// so, which makes the odds 8 to 1 by Laplace's rule of succession; the default is half of it.
    pub fn of_inside(&self, has_replicates: bool) -> f64 {
        self.inside.map_or(if has_replicates { 1.0 } else { 4.0 }, Positive::get)
    }
}

/// Data held out of calibration and search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HoldOut {
    /// Fraction of the replicates of each condition to hold out, drawn with the study's seed: at least one of three or
    /// more, and always leaving two. If no condition has three replicates and nothing else is held out, the same
    /// fraction of up to 24 blocks of each curve is held out instead, at most every third block.
    pub replicates: Fraction,
    /// Scenarios to hold out completely, by name. Default: none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub scenarios: Vec<String>,
    /// Curves to hold out completely, by their labels, such as `{ sensor = ["B"] }`. Default: none.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub on: On,
    /// Intervals of the last axis to hold out of every curve, in the unit of the axis, such as `[[0.004, 0.005]]`.
    /// Default: none.
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
    /// Name of the effect in the results of the search. Default: the name of its plugin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<Name>,
}

/// `[gap]` with its lists.
#[derive(Default)]
pub struct Gap {
    /// The section's own keys.
    pub keys: GapSection,
    /// `[[gap.candidate]]`: candidate effects with given options.
    pub candidates: Vec<Section<dyn Effect, CandidateKeys>>,
    /// `[[gap.switch]]`, `[[gap.term]]`, `[[gap.model]]`: candidates inside the model.
    pub inside: Inside,
    /// `[[gap.runs]]`: further tables of runs, each with a suspected piece of physics in the simulator.
    pub runs: Vec<Section<dyn Reader, RunsKeys>>,
    /// `[gap.companion]`.
    pub companion: Option<Box<Companion>>,
    added: Added,
}

impl Gap {
    /// Returns true if the physics of a table of runs is part of the study.
    pub fn is_added(&self, runs: &RunsKeys) -> bool {
        self.keys.add.contains(&runs.name)
    }

    /// Sets the effects of the tables of runs whose physics is part of the study, which are learned once it runs.
    pub fn set_added(&self, effects: Vec<AddedCandidate>) {
        self.added.set(effects);
    }

    /// The candidates that are part of the study: those inside the companion, then those of tables of runs.
    pub fn added(&self) -> impl Iterator<Item = &AddedCandidate> {
        let inside = self.companion.iter().flat_map(|companion| companion.added());
        inside.chain(self.added.of(self.keys.add.iter().map(Name::as_str)))
    }

    /// Returns true if the study has such candidates.
    pub fn has_added(&self) -> bool {
        let companion = self.companion.as_ref();
        !self.keys.add.is_empty() || companion.is_some_and(|c| !c.keys.add.is_empty())
    }
}

/// The lists and sections of `[gap]`.
const LISTS: [&str; 6] = ["candidate", "switch", "term", "model", "runs", "companion"];

/// Reads `[gap]`, with the defaults if the study does not have it; `None` after reporting an error.
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
        let runs = node.get("runs").map(Node::elements).unwrap_or_default().iter();
        let runs: Vec<Option<_>> = runs
            .map(|node| problems.within("runs", |problems| section(node, None, problems)))
            .collect();
        let runs = runs.into_iter().collect::<Option<_>>();
        let candidates = candidates.into_iter().collect::<Option<_>>();
        let (keys, candidates, inside, runs) = (keys?, candidates?, inside?, runs?);
        Some(Gap { keys, candidates, inside, runs, ..Gap::default() })
    })
}
