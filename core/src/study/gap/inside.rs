//! What `[gap]` says of pieces that may be missing inside the model: inputs to set free, terms to add to equations,
//! other models.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::data::Unit;
use crate::math::distribution::Distribution;
use crate::plugin::registry::{Built, Section, section};
use crate::plugin::{Model, Term};
use crate::study::decode::decode;
use crate::study::file::ModelKeys;
use crate::study::quantity::Quantity;
use crate::study::values::Name;
use crate::study::{Node, Problems};

/// An input of the model that the study holds fixed and that may have to be free.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SwitchSection {
    /// The input of the model.
    pub input: String,
    /// The unit of `absent` and `prior`; that of the model when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// The value at which what it stands for is absent, which is the value at which the study holds it: its value in `fixed`
    /// of `[model]`, or the model's default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub absent: Option<f64>,
    /// Where it may lie once it is free.
    pub prior: Distribution,
    /// What it stands for, in words; the model's description of the input when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
}

/// The engine's keys of `[[gap.term]]`: a term that the model's equations may lack.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TermKeys {
    /// The state to whose rate it is added.
    pub state: String,
    /// What its coefficient is called; the name of the term when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<Name>,
    /// Where the coefficient may lie; when left out, a normal law in whose standard deviation the term is half as large
    /// as the rate it is added to, both as root mean squares along the run at the middle of the priors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<Distribution>,
}

/// The engine's keys of `[[gap.model]]`: another model in place of the study's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SwapKeys {
    /// What it is called when it is found.
    pub name: Name,
    /// Values of inputs that are not calibrated, beside those of `fixed` in `[model]` that this model has too.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub fixed: BTreeMap<String, Quantity>,
}

/// Another model in place of the study's.
pub struct Swap {
    /// Its keys as they are written.
    pub keys: SwapKeys,
    /// The model, as a section of a study that has it.
    pub section: Section<dyn Model, ModelKeys>,
}

/// The pieces.
#[derive(Default)]
pub struct Inside {
    /// `[[gap.switch]]`.
    pub switches: Vec<SwitchSection>,
    /// `[[gap.term]]`.
    pub terms: Vec<Section<dyn Term, TermKeys>>,
    /// `[[gap.model]]`.
    pub models: Vec<Swap>,
}

impl TermKeys {
    /// What the coefficient of a term is called.
    pub fn name<'a>(&'a self, term: &Built<dyn Term>) -> &'a str {
        self.name.as_ref().map_or(term.name, AsRef::as_ref)
    }
}

impl Inside {
    /// Of the section `[gap]`.
    pub(super) fn of(gap: &Node, problems: &mut Problems) -> Option<Self> {
        Some(Self {
            switches: each(gap, "switch", problems, decode)?,
            terms: each(gap, "term", problems, |node, problems| section(node, None, problems))?,
            models: each(gap, "model", problems, swap)?,
        })
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.switches.is_empty() && self.terms.is_empty() && self.models.is_empty()
    }
}

fn each<T>(
    gap: &Node,
    list: &str,
    problems: &mut Problems,
    read: impl Fn(&Node, &mut Problems) -> Option<T>,
) -> Option<Vec<T>> {
    let nodes = gap.get(list).map(Node::elements).unwrap_or_default();
    let all: Vec<Option<T>> =
        nodes.iter().map(|node| problems.within(list, |problems| read(node, problems))).collect();
    all.into_iter().collect()
}

fn swap(node: &Node, problems: &mut Problems) -> Option<Swap> {
    let Section { common: keys, built } = section::<dyn Model, SwapKeys>(node, None, problems)?;
    let common = ModelKeys { fixed: keys.fixed.clone(), ..ModelKeys::default() };
    Some(Swap { keys, section: Section { common, built } })
}
