//! A section inside a model's options that chooses a plugin of its own: a part of a chain, the reader of a command's
//! output.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use lacuna::plugin::registry::{Kind, Section, section};
use lacuna::plugin::{Component, Library};
use lacuna::run::Fault;
use lacuna::text::problem::{Complaints, Problem, Problems};
use lacuna::text::read::read;
use lacuna::text::{Node, Place, Sources, emit};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A plugin of the kind `K` with the keys `C` next to its options, as written in a study. Errors of its options are
/// kept for the check of the model, which alone knows their position.
pub struct Nested<K: ?Sized, C> {
    written: toml::Table,
    section: Result<Section<K, C>, Vec<Problem>>,
}

impl<K: Kind + ?Sized, C: DeserializeOwned> Nested<K, C> {
    /// Builds the section from these entries.
    pub fn of(written: toml::Table) -> Self {
        let mut problems = Problems::new();
        let section = decode(&written, &mut problems);
        Self { section: section.ok_or_else(|| owned(&problems)), written }
    }
}

impl<K: ?Sized, C> Nested<K, C> {
    /// Returns the plugin and the keys next to it, or the errors of its options.
    pub fn section(&self) -> Result<&Section<K, C>, &[Problem]> {
        self.section.as_ref().map_err(Vec::as_slice)
    }
}

impl<K: Component + Kind + ?Sized, C> Nested<K, C> {
    /// Returns the faults of the plugin's libraries that have stopped answering.
    pub fn faults(&self) -> Vec<Arc<Fault>> {
        self.section().map_or_else(|_| Vec::new(), |section| section.built.plugin.faults())
    }

    /// Returns the libraries that the plugin needs.
    pub fn libraries(&self) -> Vec<&'static Library> {
        self.section().map_or_else(|_| Vec::new(), |section| section.built.libraries())
    }

    /// Returns the revisions of the plugin and of those that it uses.
    pub fn revisions(&self) -> BTreeMap<String, u32> {
        self.section().map_or_else(|_| BTreeMap::new(), |section| section.built.revisions())
    }
}

fn decode<K: Kind + ?Sized, C: DeserializeOwned>(
    written: &toml::Table,
    problems: &mut Problems,
) -> Option<Section<K, C>> {
    let text = match emit::to_toml(written) {
        Ok(text) => text,
        Err(error) => {
            problems.report(None, format!("the options of the {}: {error}", K::NAME));
            return None;
        }
    };
    let mut sources = Sources::default();
    let source = sources.add_argument(K::NAME, text);
    let node = read(source, &sources, problems)?;
    section(&node, None, problems)
}

fn owned(problems: &Problems) -> Vec<Problem> {
    problems.sorted().into_iter().cloned().collect()
}

/// Collects the problems that a nested plugin reports, with paths in its own options.
pub fn complaints(look: impl FnOnce(&mut Complaints<'_>)) -> Vec<Problem> {
    let (mut problems, mut sources) = (Problems::new(), Sources::default());
    let options = Node::table(Place::whole(sources.add_argument("options", String::new())));
    look(&mut Complaints::new(&options, &mut problems));
    owned(&problems)
}

/// Repeats problems of a nested section at its position `place` in the model's options; each message begins with
/// `who`.
pub fn pass_on(place: &str, who: &str, problems: &[Problem], complaints: &mut Complaints<'_>) {
    for problem in problems {
        let path = format!("{place}.{}", problem.path);
        let spot = complaints.at(path.trim_end_matches('.'));
        let said = spot.say(format!("{who}{}", problem.message));
        said.expected.clone_from(&problem.expected);
        said.found.clone_from(&problem.found);
        said.help.clone_from(&problem.help);
    }
}

impl<K: ?Sized, C> fmt::Debug for Nested<K, C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Nested").field(&self.written).finish()
    }
}

impl<K: ?Sized, C> Serialize for Nested<K, C> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut whole = self.written.clone();
        if let Ok(section) = &self.section {
            whole.extend(section.built.options.clone());
        }
        whole.serialize(serializer)
    }
}

impl<'de, K: Kind + ?Sized, C: DeserializeOwned> Deserialize<'de> for Nested<K, C> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        toml::Table::deserialize(deserializer).map(Self::of)
    }
}
