//! Candidates inside the model in `[gap]`: inputs to set free, terms to add to equations, other models.

use std::collections::BTreeMap;

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::registry::{Built, Section, section};
use lacuna::plugin::{Model, Term};
use lacuna::text::decode::decode;
use lacuna::text::quantity::Quantity;
use lacuna::text::values::Name;
use lacuna::text::{Node, Problems};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::companion::CompanionKeys;
use crate::study::file::ModelKeys;

/// An input of the model that the study holds fixed and that the search may set free.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SwitchSection {
    /// Name of the model input.
    pub input: String,
    /// Unit of `absent` and `prior`. Default: the unit of the model input.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Value of the input at which the effect is absent. It is the value at which the study holds the input: its value
    /// in `fixed` of `[model]`, or the model's default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub absent: Option<f64>,
    /// Prior of the input once it is free.
    pub prior: Distribution,
    /// Name of the effect in words; the model's description of the input when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// The place at which the input acts, if other inputs are the same physics at other places: `{ of = "leak", at = 0.25 }`. They are
    /// one candidate then, `of`, with its place as a further unknown. Only in `[[gap.companion.switch]]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<SwitchPlace>,
}

/// The place of an input among those that are the same physics.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SwitchPlace {
    /// Name of the physics, which is that of the candidate.
    pub of: Name,
    /// Coordinate of the place, in a unit of your own.
    pub at: f64,
}

/// The engine's keys of `[[gap.term]]`: a term that may be missing in the model's equations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TermKeys {
    /// State to whose rate the term is added.
    pub state: String,
    /// Name of the coefficient; the name of the term when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<Name>,
    /// Prior of the coefficient. When left out, a t distribution of three degrees of freedom about zero, folded there for a
    /// coefficient of one sign: at its scale the term is half as large as the rate it is added to, both as root mean
    /// squares along the run at the medians of the priors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<Distribution>,
}

/// The engine's keys of `[[gap.model]]`: another model in place of the study's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SwapKeys {
    /// Name of the model in the results.
    pub name: Name,
    /// Values of inputs that are not calibrated, in addition to those of `fixed` in `[model]` that this model has too.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub fixed: BTreeMap<String, Quantity>,
}

/// Another model in place of the study's.
pub struct Swap {
    /// The keys as written.
    pub keys: SwapKeys,
    /// The model, as a section of a study that uses it.
    pub section: Section<dyn Model, ModelKeys>,
}

/// Candidates inside the model.
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
    /// The name of the coefficient of a term.
    pub fn name<'a>(&'a self, term: &Built<dyn Term>) -> &'a str {
        self.name.as_ref().map_or(term.name, AsRef::as_ref)
    }
}

impl Inside {
    /// Reads the candidates from the section `[gap]`.
    pub(super) fn of(gap: &Node, problems: &mut Problems) -> Option<Self> {
        Some(Self {
            switches: each(gap, "switch", problems, decode)?,
            terms: each(gap, "term", problems, |node, problems| section(node, None, problems))?,
            models: each(gap, "model", problems, swap)?,
        })
    }

    /// Reads the candidates from the section `[gap.companion]`, whose keys are known.
    pub(super) fn of_companion(
        node: &Node,
        keys: &CompanionKeys,
        problems: &mut Problems,
    ) -> Option<Self> {
        let terms = each(node, "term", problems, |node, problems| section(node, None, problems))?;
        Some(Self { switches: keys.switch.clone(), terms, models: Vec::new() })
    }

    /// Returns true if there are no candidates inside the model.
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
