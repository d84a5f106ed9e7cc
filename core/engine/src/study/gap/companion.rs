//! `[gap.companion]`: a cheap model of the same physics, inside which candidates act.

use std::collections::BTreeMap;
use std::sync::Arc;

use lacuna::data::Parameter;
use lacuna::plugin::Model;
use lacuna::plugin::registry::{Section, section};
use lacuna::text::quantity::Quantity;
use lacuna::text::values::{Count, Positive};
use lacuna::text::{Complaints, Node, Problems};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;
use toml::Table;

use super::added::{Added, AddedCandidate};
use super::inside::{Inside, SwitchSection};
use super::{Gap, GapSection};
use crate::study::Study;
use crate::study::file::{ModelKeys, ParameterSection, Prior};
use crate::study::table::PluginSections;
use crate::study::unknowns::{Unknown, unknowns};

/// The engine's keys of `[gap.companion]`: a cheap model of the same physics as the simulator, which is a black box.
///
/// Candidates act inside it, and the change of its response is added to that of the emulator:
/// `emulator(parameters) + [companion(parameters, candidate) - companion(parameters)]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct CompanionKeys {
    /// Values of inputs of the companion that are not calibrated, in addition to those of `fixed` in `[model]` that it
    /// has too.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub fixed: BTreeMap<String, Quantity>,
    /// Constants of the companion: inputs that are identified from the simulation runs, each as a `[[parameter]]`.
    /// Default: none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parameter: Vec<ParameterSection>,
    /// Candidates inside the companion: inputs that it holds fixed, each as a `[[gap.switch]]`. Default: none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub switch: Vec<SwitchSection>,
    /// Candidates inside the companion: terms of its equations, each as a `[[gap.term]]`. Default: none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(with = "Vec<serde_json::Map<String, serde_json::Value>>")]
    pub term: Vec<Table>,
    /// `true` also tries the library's terms that the study does not name, if the companion is written as equations.
    pub terms: bool,
    /// Largest root mean square error of the companion on simulation runs that did not identify it, divided by the root
    /// mean square of the response. A companion with a larger error is not used, and the verdict says so.
    pub gate: Positive,
    /// Number of simulation runs from which the constants are identified, spread over the parameters.
    pub runs: Count,
    /// Values of the constants that were identified earlier, by name, in the units of `[[gap.companion.parameter]]`.
    /// With a value for each, none is identified again. Default: none.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub constants: BTreeMap<String, f64>,
    /// Point near which the changes of `add` are learned: values of the study's parameters, and sizes of the candidates, by
    /// name, in their units. Default: the medians of the parameters' priors, and the whole priors of the sizes.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub around: BTreeMap<String, f64>,
    /// Candidates that are part of the study: their changes are added to every response, and their unknowns are
    /// calibrated. Needs `constants`. Default: none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub add: Vec<String>,
}

impl Default for CompanionKeys {
    fn default() -> Self {
        let gate = Positive::new(0.1).unwrap_or_else(|_| unreachable!("a tenth"));
        let runs = Count::new(3).unwrap_or_else(|_| unreachable!("three"));
        Self {
            fixed: BTreeMap::new(),
            parameter: Vec::new(),
            switch: Vec::new(),
            term: Vec::new(),
            terms: true,
            gate,
            runs,
            constants: BTreeMap::new(),
            around: BTreeMap::new(),
            add: Vec::new(),
        }
    }
}

/// The companion of a study.
pub struct Companion {
    /// The keys as written.
    pub keys: CompanionKeys,
    /// The companion as the model of a study without a surrogate. The parameters are those of the study, then the
    /// constants; the candidates are those of the companion.
    pub study: Arc<Study>,
    added: Added,
}

/// Reads `[gap.companion]` of a study; `None` after reporting an error.
pub(in crate::study) fn companion(
    study: &Study,
    node: &Node,
    problems: &mut Problems,
) -> Option<Companion> {
    let Section { common: keys, built } =
        section::<dyn Model, CompanionKeys>(node, None, problems)?;
    let inside = Inside::of_companion(node, &keys, problems)?;
    let (parameters, unknowns) = with_constants(study, &keys, node, problems)?;
    let common = ModelKeys { fixed: keys.fixed.clone(), ..ModelKeys::default() };
    let plugins =
        PluginSections { model: Some(Section { common, built }), ..PluginSections::default() };
    let gap = Gap {
        keys: GapSection { terms: keys.terms, ..GapSection::default() },
        inside,
        ..Gap::default()
    };
    let study = study.companion_of(parameters, unknowns, plugins, gap);
    Some(Companion { keys, study: Arc::new(study), added: Added::default() })
}

/// The parameters of a study, then the constants; those of the study have the names that they have there.
fn with_constants(
    study: &Study,
    keys: &CompanionKeys,
    node: &Node,
    problems: &mut Problems,
) -> Option<(Vec<Parameter>, Vec<Unknown>)> {
    let before = problems.len();
    let own = |section: &ParameterSection| match &section.prior {
        Some(Prior::Own(law)) => Some(law.clone()),
        _ => None,
    };
    let of_run = |c: &&ParameterSection| matches!(c.prior, Some(Prior::Earlier { .. }));
    let bounded = |c: &&ParameterSection| matches!(c.prior, Some(Prior::Interval { .. }));
    for constant in keys.parameter.iter().filter(bounded) {
        Complaints::new(node, problems)
            .at(&format!("parameter.{}.prior", constant.name))
            .say("a constant of the companion is estimated, which an interval does not allow")
            .expected("a distribution");
    }
    for constant in keys.parameter.iter().filter(of_run) {
        Complaints::new(node, problems)
            .at(&format!("parameter.{}.prior", constant.name))
            .say("a constant of the companion cannot take its prior from a run")
            .expected("a distribution");
    }
    for constant in keys.parameter.iter().filter(|constant| constant.scenario.is_some()) {
        Complaints::new(node, problems)
            .at(&format!("parameter.{}.scenario", constant.name))
            .say("a constant of the companion has one value under all conditions")
            .help("take `scenario` out");
    }
    if problems.len() > before {
        return None;
    }
    let (own, names, _) =
        unknowns(&keys.parameter, &[], &PluginSections::default(), own, node, problems);
    let mut parameters = study.parameters.clone();
    parameters.extend(own);
    let mut all = study.unknowns.clone();
    all.extend(names);
    Some((parameters, all))
}

impl Companion {
    /// The number of parameters of the study, which come before the constants.
    pub fn own(&self) -> usize {
        self.study.parameters.len() - self.keys.parameter.len()
    }

    /// The point of the study's parameters near which changes are learned for `add`.
    pub fn centre(&self) -> Vec<f64> {
        let own = self.study.parameters[..self.own()].iter();
        own.map(|p| self.keys.around.get(&p.name).copied().unwrap_or_else(|| p.prior.quantile(0.5)))
            .collect()
    }

    /// The companion as plain data, for the hash of results that depend on it.
    pub fn identity(&self) -> serde_json::Value {
        let model = self.study.model.as_ref().map(|model| model.built.identity());
        let terms = self.study.gap.inside.terms.iter();
        let terms: Vec<_> = terms.map(|t| (t.built.identity(), &t.common)).collect();
        json!([model, self.keys, terms])
    }

    /// Sets the effects of the candidates that are part of the study, which are built from its model once it runs.
    pub fn set_added(&self, effects: Vec<AddedCandidate>) {
        self.added.set(effects);
    }

    /// The candidates that are part of the study.
    pub fn added(&self) -> &[AddedCandidate] {
        self.added.of(self.keys.add.iter().map(String::as_str))
    }

    /// The values of the constants, in their order, if the study states all of them.
    pub fn stated(&self) -> Option<Vec<f64>> {
        let value = |own: &ParameterSection| self.keys.constants.get(own.name.as_str()).copied();
        self.keys.parameter.iter().map(value).collect()
    }
}
