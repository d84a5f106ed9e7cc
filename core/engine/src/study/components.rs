//! The plugins that a study chose.

use std::sync::Arc;

use lacuna::data::Layout;
use lacuna::data::layouts::SCENARIO;
use lacuna::plugin::effect::{On, Placed};
use lacuna::plugin::registry::Section;
use lacuna::plugin::{Context, Effect};
use lacuna::run::Fault;
use serde_json::json;

use super::fidelity::Cheap;
use super::file::EffectKeys;
use super::plain::Study;
use super::table::Chosen;

/// Name of an effect: its own name, or that of its plugin.
pub(super) fn effect_name(section: &Section<dyn Effect, EffectKeys>) -> &str {
    section.common.name.as_ref().map_or(section.built.name, AsRef::as_ref)
}

/// The place of an effect inside some scenarios.
fn within(keys: &EffectKeys, scenarios: &[String]) -> On {
    let mut on = keys.on.clone();
    let own = on.remove(SCENARIO);
    let kept = |name: &&String| own.as_ref().is_none_or(|own| own.contains(name));
    on.insert(SCENARIO.to_owned(), scenarios.iter().filter(kept).cloned().collect());
    on
}

impl Study {
    /// Context of a plugin for a response of shape `layout`: the response to a block of scenarios or, for models and
    /// readers, to one scenario.
    pub fn context_of<'a>(&'a self, layout: &'a Layout) -> Context<'a> {
        let made = self.design.as_ref().map(|design| design.common.total());
        let kept = self.surrogate.as_ref().map_or(0, |s| s.common.validation);
        let training = self.surrogate.as_ref().and_then(|s| s.common.training).map(usize::from);
        let runs = training.or_else(|| made.map(|made| made.saturating_sub(kept)));
        let emulator = self.discrepancy.as_ref().is_some_and(|d| d.common.emulator_error);
        Context {
            directory: &self.directory,
            parameters: &self.parameters,
            given: &self.given,
            scenarios: &self.scenarios,
            layout,
            runs,
            common_errors: self.numerical_error.is_some() || emulator,
            starts_programs: true,
        }
    }

    /// The plugins of all sections in the order in which a study is written; every `[[effect]]`,
    /// `[[quantity]]` and `[[reliability]]` is one.
    pub fn components(&self) -> Vec<Chosen<'_>> {
        let mut all = self.plugins.chosen();
        all.extend(self.effects.iter().map(|e| Chosen::of("effect", &e.built, &*e.built.plugin)));
        let asked = self.quantities.iter();
        all.extend(asked.map(|q| Chosen::of("quantity", &q.built, &*q.built.plugin)));
        let rare = self.reliability.iter();
        all.extend(rare.map(|r| Chosen::of("reliability", &r.built, &*r.built.plugin)));
        all
    }

    /// Candidate effects of `[[gap.candidate]]`.
    pub(super) fn tried(&self) -> impl Iterator<Item = Chosen<'_>> {
        let all = self.gap.candidates.iter();
        all.map(|tried| Chosen::of("gap.candidate", &tried.built, &*tried.built.plugin))
    }

    /// Plugins of finer and cheaper runs: the models, readers of cheaper runs, and surrogates of the differences.
    pub(super) fn of_other_cost(&self) -> Vec<Chosen<'_>> {
        let mut all = Vec::new();
        if let Some(error) = &self.numerical_error {
            let (model, surrogate) = (&error.model.built, error.surrogate.as_ref());
            all.push(Chosen::of("numerical_error", model, &*model.plugin));
            all.extend(
                surrogate
                    .map(|s| Chosen::of("numerical_error.surrogate", &s.built, &*s.built.plugin)),
            );
        }
        if let Some(low) = &self.low_fidelity {
            all.push(match &low.source {
                Cheap::Model(model, _) => {
                    Chosen::of("low_fidelity", &model.built, &*model.built.plugin)
                }
                Cheap::Reader(reader) => {
                    Chosen::of("low_fidelity.simulations", &reader.built, &*reader.built.plugin)
                }
            });
            all.extend(
                low.surrogate
                    .as_ref()
                    .map(|s| Chosen::of("low_fidelity.surrogate", &s.built, &*s.built.plugin)),
            );
        }
        all
    }

    /// Options of every plugin, each with the name of its section.
    pub(super) fn options<'s>(&'s self) -> Vec<(&'static str, &'s toml::Table)> {
        let of = |chosen: Chosen<'s>| (chosen.section, chosen.options);
        let mut all: Vec<_> = self.plugins.chosen().into_iter().map(of).collect();
        all.extend(self.numerical_error.iter().map(|e| ("model", &e.model.built.options)));
        if let Some(Cheap::Model(model, _)) = self.low_fidelity.as_ref().map(|low| &low.source) {
            all.push(("model", &model.built.options));
        }
        all.extend(self.effects.iter().map(|effect| ("effect", &effect.built.options)));
        all.extend(self.quantities.iter().map(|q| ("quantity", &q.built.options)));
        all.extend(self.reliability.iter().map(|r| ("reliability", &r.built.options)));
        all.extend(self.tried().map(of));
        all
    }

    /// Handles through which plugins report a fault after which they give no further results.
    pub fn faults(&self) -> Vec<Arc<Fault>> {
        let other = self.of_other_cost().into_iter().map(|chosen| chosen.plugin.faults());
        let tried = self.tried().map(|chosen| chosen.plugin.faults());
        let chosen = self.components().into_iter().map(|chosen| chosen.plugin.faults());
        chosen.chain(other).chain(tried).flatten().collect()
    }

    /// Returns true if the study changes the response of its model by effects or by candidates of `[gap]`.
    pub fn has_effects(&self) -> bool {
        !self.effects.is_empty() || self.gap.has_added()
    }

    /// The effects as plain data, for the hash of results that depend on them.
    pub fn effects_identity(&self) -> Vec<serde_json::Value> {
        let own = self.effects.iter().map(|e| json!((e.built.identity(), &e.common)));
        own.chain(self.gap.added().map(|added| json!((&added.name, &added.origin)))).collect()
    }

    /// The effects with their names and places: first those of added candidates, which are physics of the model.
    pub fn placed_effects<'a>(&'a self) -> Vec<Placed<'a>> {
        let place = |section: &'a Section<dyn Effect, EffectKeys>| {
            let Section { built, common, .. } = section;
            let placed = |name: &str, on: &On| Placed::new(name, &*built.plugin, &self.layouts, on);
            let name = effect_name(section);
            match &common.by {
                None => vec![placed(name, &common.on)],
                Some(by) => self
                    .groups_of(by)
                    .iter()
                    .map(|(group, names)| {
                        placed(&format!("{name}[{group}]"), &within(common, names))
                    })
                    .filter(|placed| placed.acts.contains(&true))
                    .collect(),
            }
        };
        let inside = self
            .gap
            .added()
            .map(|added| Placed::new(&added.name, &*added.effect, &self.layouts, &On::new()));
        inside.chain(self.effects.iter().flat_map(place)).collect()
    }

    /// Groups of scenarios by a label, or by their names for `scenario`: the name of each group and those of its scenarios. A
    /// scenario without the label is in none.
    pub fn groups_of(&self, by: &str) -> Vec<(String, Vec<String>)> {
        let mut groups: Vec<(String, Vec<String>)> = Vec::new();
        for scenario in &self.scenarios {
            let own = if by == SCENARIO { Some(&scenario.name) } else { scenario.labels.get(by) };
            let Some(own) = own else { continue };
            match groups.iter_mut().find(|(group, _)| group == own) {
                Some((_, names)) => names.push(scenario.name.clone()),
                None => groups.push((own.clone(), vec![scenario.name.clone()])),
            }
        }
        groups
    }
}
