//! The table of sections: each section of the study language is one row, in the order in which a study is written.
//!
//! A row says how a section is written: a `table` of the engine's keys, a `list` of such tables, or keys of the engine's
//! beside the options of a `plugin` (its kind, the engine's keys, the plugin of a study that chooses none), once or as a
//! list of `plugins`. From the rows follow the names of the sections, the fields of [`PluginSections`] and how they are read,
//! the keys that stay when a plugin changes, what `resolved.toml` says of them, the JSON Schema and the manual.

use lacuna::plugin::manual::Manual;
use lacuna::plugin::registry::{Built, Kind, NoKeys, Section, section};
use lacuna::plugin::{
    Component, Density, Design, Discrepancy, Effect, Executor, Model, Quantity, Reader,
    Reliability, Sampler, Surrogate,
};
use lacuna::text::decode::fields;
use lacuna::text::emit::{Unwritable, to_table};
use lacuna::text::{Node, Problems};
use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::Table;

use super::dependence::{ConstraintSection, DependenceSection};
use super::field::FieldSection;
use super::file::{
    CasesKeys, DerivedSection, DesignKeys, DiscrepancyKeys, EffectKeys, LowFidelitySection,
    MeasurementKeys, ModelKeys, NumericalErrorSection, ParameterSection, ResponseSection,
    SamplerKeys, ScenarioSection, SimulationKeys, StudySection, SurrogateKeys, ValidateSection,
};
use super::forward::ForwardSection;
use super::gap::GapSection;
use super::libraries::PluginsSection;
use super::predict::PredictSection;
use super::quantity::QuantityKeys;
use super::reliability::ReliabilityKeys;
use super::schema::{Language, page};
use super::start::StartSection;

/// Writes what follows from the rows. Of the five forms of a row each part of the macro uses those it concerns.
macro_rules! sections {
    ($(
        $name:ident:
        $(table($table:ty))?
        $(list($element:ty))?
        $(plugin($kind:ident, $keys:ty $(, else $default:literal)?))?
        $(plugins($each:ident, $each_keys:ty))?;
    )+) => {
        /// The names of all sections, in the order in which a study is written.
        pub const SECTIONS: &[&str] = &[$(stringify!($name)),+];

        /// The sections that choose a plugin.
        #[derive(Default)]
        pub struct PluginSections {
            $($(
                #[doc = concat!("`[", stringify!($name), "]`.")]
                pub $name: Option<Section<dyn $kind, $keys>>,
            )?)+
        }

        impl PluginSections {
            /// Reads them from a study; what is wrong is left out and reported.
            pub(super) fn read(root: &Node, problems: &mut Problems) -> Self {
                Self {
                    $($($name: chosen(root, stringify!($name), default!($($default)?), problems),)?)+
                }
            }

            /// The plugins that are chosen.
            pub fn chosen(&self) -> Vec<Chosen<'_>> {
                let mut all = Vec::new();
                $($(if let Some(section) = &self.$name {
                    let built: &Built<dyn $kind> = &section.built;
                    all.push(Chosen::of(stringify!($name), built, &*built.plugin));
                })?)+
                all
            }

            /// The sections with every default filled in.
            pub(super) fn written(&self) -> Result<Vec<(&'static str, Table)>, Unwritable> {
                let mut all = Vec::new();
                $($(if let Some(section) = &self.$name {
                    let section: &Section<dyn $kind, $keys> = section;
                    all.push((stringify!($name), written(section)?));
                })?)+
                Ok(all)
            }
        }

        /// The engine's own keys of a section, which stay when its plugin changes.
        pub(super) fn common_keys(section: &str) -> &'static [&'static str] {
            $($(if section == stringify!($name) { return fields::<$keys>(); })?)+
            $($(if section == stringify!($name) { return fields::<$each_keys>(); })?)+
            &[]
        }

        /// Adds all sections to a schema.
        pub(super) fn describe(language: &mut Language) {
            $({
                let name = stringify!($name);
                $(language.table::<$table>(name);)?
                $(language.tables::<$element>(name);)?
                $(language.section::<dyn $kind, $keys>(name, default!($($default)?));)?
                $(language.sections::<dyn $each, $each_keys>(name);)?
            })+
        }

        /// The manual of the engine's keys in all sections.
        pub(super) fn manual() -> Vec<Manual> {
            let pages = [$({
                let name = stringify!($name);
                $(page::<$table>(&format!("[{name}]")))?
                $(page::<$element>(&format!("[[{name}]]")))?
                $(page::<$keys>(&format!("[{name}]")))?
                $(page::<$each_keys>(&format!("[[{name}]]")))?
            }),+];
            pages.into_iter().filter(|page| !page.options.is_empty()).collect()
        }
    };
}

/// The plugin of a study that chooses none.
macro_rules! default {
    () => {
        None
    };
    ($name:literal) => {
        Some($name)
    };
}

sections! {
    study: table(StudySection);
    plugins: table(PluginsSection);
    parameter: list(ParameterSection);
    field: list(FieldSection);
    start: list(StartSection);
    dependence: list(DependenceSection);
    constraint: list(ConstraintSection);
    target: plugin(Density, NoKeys);
    derived: list(DerivedSection);
    scenario: list(ScenarioSection);
    predict: list(PredictSection);
    response: table(ResponseSection);
    model: plugin(Model, ModelKeys);
    design: plugin(Design, DesignKeys);
    executor: plugin(Executor, NoKeys, else "local");
    cases: plugin(Executor, CasesKeys);
    simulations: plugin(Reader, SimulationKeys);
    measurements: plugin(Reader, MeasurementKeys);
    surrogate: plugin(Surrogate, SurrogateKeys);
    discrepancy: plugin(Discrepancy, DiscrepancyKeys);
    numerical_error: table(NumericalErrorSection);
    low_fidelity: table(LowFidelitySection);
    effect: plugins(Effect, EffectKeys);
    sampler: plugin(Sampler, SamplerKeys);
    quantity: plugins(Quantity, QuantityKeys);
    forward: table(ForwardSection);
    reliability: plugins(Reliability, ReliabilityKeys);
    validate: table(ValidateSection);
    gap: table(GapSection);
}

/// A plugin that a study chose.
pub struct Chosen<'a> {
    /// Section of the study: `"sampler"`.
    pub section: &'static str,
    /// Name of the plugin: `"nested"`.
    pub name: &'static str,
    /// The plugin with its options.
    pub plugin: &'a dyn Component,
    /// Options of the plugin, with the defaults filled in.
    pub options: &'a Table,
}

impl<'a> Chosen<'a> {
    /// The plugin `built`, seen as a component too.
    pub(super) fn of<K: ?Sized>(
        section: &'static str,
        built: &'a Built<K>,
        plugin: &'a dyn Component,
    ) -> Self {
        Self { section, name: built.name, plugin, options: &built.options }
    }
}

/// Reads a section; one with a default is there even when it is not written.
fn chosen<K: Kind + ?Sized, C: DeserializeOwned>(
    root: &Node,
    name: &str,
    default: Option<&str>,
    problems: &mut Problems,
) -> Option<Section<K, C>> {
    let unwritten = default.map(|_| Node::table(root.place.clone()));
    let node = root.get(name).or(unwritten.as_ref())?;
    problems.within(name, |problems| section(node, default, problems))
}

/// One table of `use`, the engine's keys and the plugin's.
pub(super) fn written<K: ?Sized, C: Serialize>(
    section: &Section<K, C>,
) -> Result<Table, Unwritable> {
    let mut table = Table::new();
    table.insert("use".to_owned(), section.built.name.into());
    table.extend(to_table(&section.common)?);
    table.extend(section.built.options.clone());
    Ok(table)
}

#[cfg(test)]
mod tests {
    use lacuna::plugin::registry::kinds;

    use super::*;

    #[test]
    fn every_kind_is_chosen_in_a_section() {
        for kind in kinds() {
            for section in kind.sections.iter().filter(|section| !section.starts_with("gap.")) {
                assert!(SECTIONS.contains(section), "{}: `{section}`", kind.name);
            }
        }
    }

    #[test]
    fn keys_of_the_engine_stay_when_a_plugin_changes() {
        assert_eq!(common_keys("sampler"), ["burn_in", "start", "stop", "imputations"]);
        assert_eq!(common_keys("effect"), ["name", "on", "by", "population"]);
        assert_eq!(common_keys("executor"), [""; 0]);
        assert_eq!(common_keys("validate"), [""; 0]);
    }
}
