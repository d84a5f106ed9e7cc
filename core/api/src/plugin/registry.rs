//! Registry: every plugin linked into the program, found by kind and name.
//!
//! A plugin registers itself with one line at the end of its file; nothing else names it.
//!
//! ```ignore
//! lacuna::register!(Surrogate, "polynomial_chaos", PolynomialChaos);
//! ```

use std::collections::BTreeMap;

use lacuna_base::text::decode::{decode, decode_beside, fields};
use lacuna_base::text::nearest::{nearest, one_of};
use lacuna_base::text::read::read;
use lacuna_base::text::{Node, Place, Problem, Problems, Sources, Value, emit};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::manual::{Manual, generator, resolve};
use super::{Component, Library};
use crate::plugin::identity::Plugin;

mod listing;
pub mod loaded;

pub use listing::{KindEntry, Listing, audit, kinds};

#[doc(hidden)]
pub use inventory;

/// A kind of plugin: the trait object that all plugins of the kind become.
///
/// Implemented by [`kind!`](crate::kind), once beside each trait.
pub trait Kind: 'static {
    /// Name of the kind, such as `surrogate`.
    const NAME: &'static str;
    /// Sections of a study that choose a plugin of this kind.
    const SECTIONS: &'static [&'static str];

    /// Every plugin of this kind that is linked into the program, in no particular order.
    fn registered() -> Vec<&'static Entry<Self>>;
}

/// One registered plugin.
pub struct Entry<K: ?Sized + 'static> {
    /// Name by which a study chooses the plugin.
    pub name: &'static str,
    /// Names used elsewhere, such as `nuts`; a study that uses one is told the name here.
    pub aliases: &'static [&'static str],
    /// Schema of the options.
    pub schema: &'static (dyn Fn(&mut SchemaGenerator) -> Schema + Send + Sync),
    /// Decodes the options; the given keys of the section belong to the engine.
    pub build: &'static Build<K>,
    /// Module of the plugin; for a plugin of a loaded library, the path of the library.
    pub module_path: &'static str,
    /// Version of the package or library.
    pub version: &'static str,
    /// Revision, raised whenever the results of the plugin change. For a library its hash is used instead.
    pub revision: u32,
    /// Library from which the plugin was loaded; `None` for a built-in plugin.
    pub library: Option<&'static Library>,
}

/// Decodes the options of a plugin from a section that also holds keys of the engine.
pub type Build<K> = dyn Fn(&Node, &[&str], &mut Problems) -> Option<Built<K>> + Send + Sync;

/// A plugin with its options.
pub struct Built<K: ?Sized> {
    /// Name by which the plugin was chosen.
    pub name: &'static str,
    /// The plugin itself.
    pub plugin: Box<K>,
    /// All options, including defaults.
    pub options: toml::Table,
    /// Library from which the plugin was loaded; `None` for a built-in plugin.
    pub library: Option<&'static Library>,
    /// Revision of the plugin; see [`Entry::revision`].
    pub revision: u32,
}

impl<K: Component + Kind + ?Sized> Built<K> {
    /// Libraries that the plugin needs, without repetition, its own first.
    pub fn libraries(&self) -> Vec<&'static Library> {
        let mut all: Vec<&'static Library> = Vec::new();
        for library in self.library.into_iter().chain(self.plugin.libraries()) {
            if !all.contains(&library) {
                all.push(library);
            }
        }
        all
    }

    /// Revisions of the plugin and of the plugins that it calls, by kind and name.
    pub fn revisions(&self) -> BTreeMap<String, u32> {
        let mut all = self.plugin.revisions();
        all.insert(format!("{}.{}", K::NAME, self.name), self.revision);
        all
    }

    /// Everything on which its results depend, for the hash of a stage's inputs: name, options, the libraries that it
    /// needs, and the revisions of its code.
    pub fn identity(&self) -> Plugin<Identity<'_>> {
        let libraries = self.libraries();
        let identity = if libraries.is_empty() {
            Identity::BuiltIn(self.name, &self.options)
        } else {
            let hashes = libraries.into_iter().map(|library| library.sha256.as_str()).collect();
            Identity::Loaded(self.name, &self.options, hashes)
        };
        Plugin { identity, revisions: self.revisions() }
    }
}

/// Identity of a plugin; see [`Built::identity`].
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Identity<'a> {
    /// Name and options of a built-in plugin.
    BuiltIn(&'a str, &'a toml::Table),
    /// Name, options and hashes of the libraries.
    Loaded(&'a str, &'a toml::Table, Vec<&'a str>),
}

impl<K: Kind + ?Sized> Entry<K> {
    /// Full name, such as `surrogate.polynomial_chaos`.
    pub fn full_name(&self) -> String {
        format!("{}.{}", K::NAME, self.name)
    }

    /// Manual page of the plugin, from the documentation of its options.
    pub fn documentation(&self) -> Manual {
        let mut generator = generator();
        let schema = (self.schema)(&mut generator);
        let mut manual =
            Manual::of_schema(&self.full_name(), &resolve(&schema, &generator), &generator);
        if !self.aliases.is_empty() {
            let names: Vec<String> = self.aliases.iter().map(|name| format!("`{name}`")).collect();
            let paragraph = format!("Known elsewhere as {}.", names.join(", "));
            let parts = [manual.prose.trim_end(), paragraph.as_str()];
            manual.prose =
                parts.into_iter().filter(|t| !t.is_empty()).collect::<Vec<_>>().join("\n\n");
        }
        manual
    }
}

/// Declares a kind of plugin; belongs beside its trait, in this crate.
///
/// ```ignore
/// crate::kind!(Surrogate, "surrogate", ["surrogate"]);
/// ```
#[macro_export]
macro_rules! kind {
    ($kind:path, $name:literal, [$($section:literal),+ $(,)?]) => {
        impl $crate::plugin::registry::Kind for dyn $kind {
            const NAME: &'static str = $name;
            const SECTIONS: &'static [&'static str] = &[$($section),+];

            fn registered() -> Vec<&'static $crate::plugin::registry::Entry<Self>> {
                $crate::plugin::registry::inventory::iter::<
                    $crate::plugin::registry::Entry<dyn $kind>,
                >
                    .into_iter()
                    .collect()
            }
        }

        $crate::plugin::registry::inventory::collect!(
            $crate::plugin::registry::Entry<dyn $kind>
        );

        $crate::plugin::registry::inventory::submit! {
            $crate::plugin::registry::KindEntry::of::<dyn $kind>()
        }
    };
}

/// Registers a plugin: its kind, its name in a study, its options type, which implements the trait of the kind; names
/// used elsewhere; and its revision, which is raised whenever its results change (1 if omitted).
///
/// `lacuna::register!(Sampler, "no_u_turn", NoUTurn, aliases: ["nuts"], revision = 2);`
#[macro_export]
macro_rules! register {
    ($kind:path, $name:literal, $options:ty $(, aliases: [$($alias:literal),+ $(,)?])? $(,)?) => {
        $crate::register!($kind, $name, $options $(, aliases: [$($alias),+])?, revision = 1);
    };
    (
        $kind:path, $name:literal, $options:ty $(, aliases: [$($alias:literal),+ $(,)?])?,
        revision = $revision:literal
    ) => {
        $crate::plugin::registry::inventory::submit! {
            $crate::plugin::registry::Entry::<dyn $kind> {
                name: $name,
                aliases: &[$($($alias),+)?],
                schema: &<$options as $crate::plugin::registry::Documented>::json_schema,
                build: &|node, beside, problems| {
                    $crate::plugin::registry::build(node, beside, problems, $name, |options| {
                        let plugin: $options = options;
                        Box::new(plugin)
                    })
                },
                module_path: module_path!(),
                version: env!("CARGO_PKG_VERSION"),
                revision: $revision,
                library: None,
            }
        }
    };
}

/// Schema of an options type, as `register!` needs it.
#[doc(hidden)]
pub trait Documented {
    fn json_schema(generator: &mut SchemaGenerator) -> Schema;
}

impl<T: JsonSchema> Documented for T {
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        generator.subschema_for::<T>()
    }
}

/// Builds a plugin from its options type, for `register!`.
#[doc(hidden)]
pub fn build<K: ?Sized, O: DeserializeOwned + Serialize>(
    node: &Node,
    beside: &[&str],
    problems: &mut Problems,
    name: &'static str,
    into_plugin: fn(O) -> Box<K>,
) -> Option<Built<K>> {
    let options: O = decode_beside(node, beside, problems)?;
    match emit::to_table(&options) {
        Ok(written) => {
            let plugin = into_plugin(options);
            Some(Built { name, plugin, options: written, library: None, revision: 1 })
        }
        Err(error) => {
            let message = format!("the options of `{name}` {error}");
            problems.report(Some(node.place.clone()), message);
            None
        }
    }
}

/// Every plugin of a kind, sorted by name.
pub fn entries<K: Kind + ?Sized>() -> Vec<&'static Entry<K>> {
    let mut entries = K::registered();
    entries.extend(loaded::entries::<K>());
    entries.sort_by_key(|entry| (entry.name, entry.module_path));
    entries
}

/// The plugin of a kind with this name.
///
/// # Errors
/// The problem to report if there is none.
pub fn find<K: Kind + ?Sized>(name: &str) -> Result<&'static Entry<K>, Box<Problem>> {
    let entries = entries::<K>();
    if let Some(entry) = entries.iter().find(|entry| entry.name == name) {
        return Ok(entry);
    }
    let names = || names_of(&entries);
    let mut problem = Problem::new(format!("there is no {} `{name}`", K::NAME));
    if entries.is_empty() {
        problem.help(format!("no {} is installed", K::NAME));
    } else {
        problem.expected(one_of(names()));
    }
    let plain = |text: &str| text.to_lowercase().replace(['-', ' ', '_'], "");
    let is_called =
        |entry: &&&Entry<K>| entry.aliases.iter().any(|alias| plain(alias) == plain(name));
    let known = entries.iter().find(is_called).map(|entry| entry.name);
    if let Some(near) = known.or_else(|| nearest(name, names())) {
        problem.help(format!("did you mean `{near}`?"));
    }
    Err(Box::new(problem))
}

/// Names of sorted entries, without repetition.
fn names_of<K: ?Sized>(entries: &[&'static Entry<K>]) -> impl Iterator<Item = &'static str> {
    let mut names: Vec<&'static str> = entries.iter().map(|entry| entry.name).collect();
    names.dedup();
    names.into_iter()
}

/// A section of a study, split by owner of the keys.
pub struct Split {
    /// Name of the plugin under `use`, and its place.
    pub chosen: Option<(String, Place)>,
    /// Keys of the engine.
    pub common: Node,
    /// All other keys, which belong to the plugin.
    pub options: Node,
}

/// Splits a section into `use`, the engine's keys and the plugin's keys.
///
/// A `use` that is not a string is reported.
pub fn split_section(section: &Node, common_keys: &[&str], problems: &mut Problems) -> Split {
    let mut split = Split {
        chosen: None,
        common: Node::table(section.place.clone()),
        options: Node::table(section.place.clone()),
    };
    for (key, node) in section.entries() {
        if key.name == "use" {
            if let Value::String(name) = &node.value {
                split.chosen = Some((name.clone(), node.place.clone()));
            } else {
                problems
                    .report(Some(node.place.clone()), "wrong value for `use`")
                    .expected("the name of a plugin")
                    .found(node.describe());
            }
        } else if common_keys.contains(&key.name.as_str()) {
            split.common.set(key.clone(), node.clone());
        } else {
            split.options.set(key.clone(), node.clone());
        }
    }
    split
}

/// A decoded section: the engine's keys, and the chosen plugin.
pub struct Section<K: ?Sized, C> {
    /// Keys of the engine.
    pub common: C,
    /// The chosen plugin.
    pub built: Built<K>,
}

/// Type of the engine's keys for a section without any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NoKeys {}

/// Decodes a section; the plugin is `default` if the section has no `use`.
pub fn section<K: Kind + ?Sized, C: DeserializeOwned>(
    node: &Node,
    default: Option<&str>,
    problems: &mut Problems,
) -> Option<Section<K, C>> {
    if !matches!(node.value, Value::Table(_)) {
        problems
            .report(Some(node.place.clone()), format!("a {} is a table", K::NAME))
            .expected("a table")
            .found(node.describe());
        return None;
    }
    let common_keys = fields::<C>();
    let split = split_section(node, common_keys, problems);
    let common = decode::<C>(&split.common, problems);
    let entry = match (split.chosen, default) {
        (Some((name, place)), _) => located::<K>(&name, place, problems),
        (None, _) if node.get("use").is_some() => None,
        (None, Some(name)) => located::<K>(name, node.place.clone(), problems),
        (None, None) => {
            problems
                .report(Some(node.place.clone()), "missing key `use`")
                .expected(one_of(names_of(&entries::<K>())));
            None
        }
    }?;
    let beside: Vec<&str> = std::iter::once("use").chain(common_keys.iter().copied()).collect();
    let built = (entry.build)(&split.options, &beside, problems)
        .map(|built| Built { revision: entry.revision, ..built });
    Some(Section { common: common?, built: built? })
}

fn located<K: Kind + ?Sized>(
    name: &str,
    place: Place,
    problems: &mut Problems,
) -> Option<&'static Entry<K>> {
    find::<K>(name)
        .map_err(|problem| {
            let path = problems.path("use");
            problems.push(Problem { place: Some(place), path, ..*problem });
        })
        .ok()
}

/// Builds a plugin from its options alone, given as TOML text, for tests, contracts and programs without a study; the
/// error lists all problems, as shown to the user.
pub fn from_text<K: Kind + ?Sized>(name: &str, options: &str) -> Result<Built<K>, String> {
    let mut sources = Sources::default();
    let mut problems = Problems::new();
    let source = sources.add_argument(&format!("{}.{name}", K::NAME), options.to_owned());
    let entry = located::<K>(name, Place::whole(source), &mut problems);
    let node = read(source, &sources, &mut problems);
    let built = entry.zip(node).and_then(|(entry, node)| {
        let built = (entry.build)(&node, &[], &mut problems)?;
        Some(Built { revision: entry.revision, ..built })
    });
    built.ok_or_else(|| problems.render(&sources))
}

#[cfg(test)]
pub(super) mod tests;
