//! The plugins that a study chose.

use std::sync::Arc;

use super::fidelity::Cheap;
use super::file::EffectKeys;
use super::resolve::Study;
use super::{Complaints, Node, Problems};
use crate::data::Layout;
use crate::plugin::effect::Placed;
use crate::plugin::registry::Section;
use crate::plugin::{Component, Context, Effect, Fault};

/// A plugin that a study chose.
pub struct Chosen<'a> {
    /// Its section: `"sampler"`.
    pub section: &'static str,
    /// Its name: `"nested"`.
    pub name: &'static str,
    /// The plugin with its options.
    pub plugin: &'a dyn Component,
}

/// The sections whose plugins see the response to one scenario.
const OF_RECORDS: [&str; 6] = [
    "model",
    "numerical_error",
    "low_fidelity",
    "low_fidelity.simulations",
    "simulations",
    "measurements",
];

/// What an effect is called: its own name, or that of its plugin.
pub(super) fn effect_name(section: &Section<dyn Effect, EffectKeys>) -> &str {
    section.common.name.as_ref().map_or(section.built.name, AsRef::as_ref)
}

impl Study {
    /// What a plugin sees of the study with a response of this shape: that of a block of scenarios, or for
    /// models and readers that to one scenario.
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

    /// The plugins of all sections in the order in which a study is written; every `[[effect]]` is one.
    pub fn components(&self) -> Vec<Chosen<'_>> {
        let mut all = Vec::new();
        macro_rules! add {
            ($($section:ident),+) => {
                $(if let Some(section) = &self.$section {
                    let (name, plugin) = (section.built.name, &*section.built.plugin);
                    all.push(Chosen { section: stringify!($section), name, plugin });
                })+
            };
        }
        add!(target, model, design, executor, simulations, measurements, surrogate, discrepancy);
        add!(sampler);
        all.extend(self.effects.iter().map(|effect| {
            let (name, plugin) = (effect.built.name, &*effect.built.plugin);
            Chosen { section: "effect", name, plugin }
        }));
        all
    }

    /// The plugins of runs of another cost: finer and cheaper models, readers of cheaper runs, surrogates of differences.
    fn of_other_cost(&self) -> Vec<Chosen<'_>> {
        let mut all = Vec::new();
        if let Some(error) = &self.numerical_error {
            let (name, plugin) = (error.model.built.name, &*error.model.built.plugin);
            all.push(Chosen { section: "numerical_error", name, plugin });
            all.extend(error.surrogate.as_ref().map(|s| Chosen {
                section: "numerical_error.surrogate",
                name: s.built.name,
                plugin: &*s.built.plugin,
            }));
        }
        if let Some(low) = &self.low_fidelity {
            all.push(match &low.source {
                Cheap::Model(model, _) => Chosen {
                    section: "low_fidelity",
                    name: model.built.name,
                    plugin: &*model.built.plugin,
                },
                Cheap::Reader(reader) => Chosen {
                    section: "low_fidelity.simulations",
                    name: reader.built.name,
                    plugin: &*reader.built.plugin,
                },
            });
            all.extend(low.surrogate.as_ref().map(|s| Chosen {
                section: "low_fidelity.surrogate",
                name: s.built.name,
                plugin: &*s.built.plugin,
            }));
        }
        all
    }

    /// The options of every plugin with the section that it stands in.
    pub(super) fn options(&self) -> Vec<(&'static str, &toml::Table)> {
        let mut all = Vec::new();
        macro_rules! add {
            ($($section:ident),+) => {
                $(if let Some(section) = &self.$section {
                    all.push((stringify!($section), &section.built.options));
                })+
            };
        }
        add!(target, model, design, executor, simulations, measurements, surrogate, discrepancy);
        add!(sampler);
        all.extend(self.numerical_error.iter().map(|e| ("model", &e.model.built.options)));
        if let Some(Cheap::Model(model, _)) = self.low_fidelity.as_ref().map(|low| &low.source) {
            all.push(("model", &model.built.options));
        }
        all.extend(self.effects.iter().map(|effect| ("effect", &effect.built.options)));
        let tried = self.gap.candidates.iter();
        all.extend(tried.map(|candidate| ("gap.candidate", &candidate.built.options)));
        all
    }

    /// Where plugins say that they can answer no more.
    pub fn faults(&self) -> Vec<Arc<Fault>> {
        let other = self.of_other_cost().into_iter().map(|chosen| chosen.plugin.faults());
        let tried = self.gap.candidates.iter().map(|candidate| candidate.built.plugin.faults());
        let chosen = self.components().into_iter().map(|chosen| chosen.plugin.faults());
        chosen.chain(other).chain(tried).flatten().collect()
    }

    /// The effects with their names and places.
    pub fn placed_effects<'a>(&'a self) -> Vec<Placed<'a>> {
        let place = |section: &'a Section<dyn Effect, EffectKeys>| {
            let Section { built, common, .. } = section;
            Placed::new(effect_name(section), &*built.plugin, &self.layouts, &common.on)
        };
        self.effects.iter().map(place).collect()
    }

    /// Calls `look` for every plugin with complaints about its own section.
    pub(super) fn each_plugin(
        &self,
        root: &Node,
        problems: &mut Problems,
        look: impl Fn(&str, &dyn Component, &Context<'_>, &mut Complaints<'_>),
    ) {
        let records: Vec<Layout> = self
            .scenarios
            .iter()
            .filter_map(|scenario| Some(self.layouts.of_scenario(&scenario.name)?.0))
            .collect();
        let unwritten = Node::table(root.place.clone());
        let mut effects = root.get("effect").map(Node::elements).unwrap_or_default().iter();
        let tried = self.gap.candidates.iter().map(|candidate| Chosen {
            section: "gap.candidate",
            name: candidate.built.name,
            plugin: &*candidate.built.plugin,
        });
        let mut candidates =
            root.find("gap.candidate").map(Node::elements).unwrap_or_default().iter();
        let all = self.components().into_iter().chain(self.of_other_cost()).chain(tried);
        for Chosen { section, plugin, .. } in all {
            let node = match section {
                "effect" => effects.next(),
                "gap.candidate" => candidates.next(),
                _ => root.find(section),
            };
            let of_records = OF_RECORDS.contains(&section);
            let layouts = if of_records { &records } else { &self.layouts.blocks };
            for layout in layouts {
                let before = problems.len();
                problems.within(section, |problems| {
                    let complaints = &mut Complaints::new(node.unwrap_or(&unwritten), problems);
                    look(section, plugin, &self.context_of(layout), complaints);
                });
                // What is wrong for one shape is most often wrong for all.
                if problems.len() > before {
                    break;
                }
            }
        }
    }
}
