//! The plugins of every kind, as data.

use super::{Entry, Kind, entries, find, inventory};
use crate::plugin::abi::Library;
use crate::plugin::manual::Manual;
use crate::study::Problem;

/// One kind of plugin, as data.
pub struct KindEntry {
    /// What the kind is called.
    pub name: &'static str,
    /// The sections of a study that choose a plugin of this kind.
    pub sections: &'static [&'static str],
    list: fn() -> Vec<Listing>,
}

inventory::collect!(KindEntry);

/// One plugin, as data.
#[derive(Clone, Copy)]
pub struct Listing {
    /// What its kind is called.
    pub kind: &'static str,
    /// Its name in a study.
    pub name: &'static str,
    /// The module it is in.
    pub module_path: &'static str,
    /// The version of the package or library it is in.
    pub version: &'static str,
    /// The number that is raised whenever what it computes changes.
    pub revision: u32,
    /// The library it was loaded from, if it is not a part of the program.
    pub library: Option<&'static Library>,
    /// Its page of the manual.
    pub documentation: fn(&str) -> Option<Manual>,
}

impl Listing {
    /// Its page of the manual.
    pub fn manual(&self) -> Option<Manual> {
        (self.documentation)(self.name)
    }
}

impl KindEntry {
    /// The kind of a trait object.
    pub const fn of<K: Kind + ?Sized>() -> Self {
        Self { name: K::NAME, sections: K::SECTIONS, list: list::<K> }
    }

    /// Every plugin of the kind, sorted by name.
    pub fn plugins(&self) -> Vec<Listing> {
        (self.list)()
    }
}

fn list<K: Kind + ?Sized>() -> Vec<Listing> {
    let listing = |entry: &'static Entry<K>| Listing {
        kind: K::NAME,
        name: entry.name,
        module_path: entry.module_path,
        version: entry.version,
        revision: entry.revision,
        library: entry.library,
        documentation: |name| find::<K>(name).ok().map(Entry::documentation),
    };
    entries::<K>().into_iter().map(listing).collect()
}

/// Every kind of plugin, in the order of the names.
pub fn kinds() -> Vec<&'static KindEntry> {
    let mut kinds: Vec<&KindEntry> = inventory::iter::<KindEntry>.into_iter().collect();
    kinds.sort_by_key(|kind| kind.name);
    kinds
}

/// Complains of names that two plugins of a kind share.
pub fn audit() -> Vec<Problem> {
    kinds().into_iter().flat_map(|kind| duplicates(&kind.plugins())).collect()
}

/// Complaints about neighbours of the same name in a sorted list.
fn duplicates(plugins: &[Listing]) -> Vec<Problem> {
    let same = plugins.windows(2).filter(|pair| pair[0].name == pair[1].name);
    same.map(|pair| {
        let Listing { kind, name, .. } = pair[0];
        let mut problem = Problem::new(format!("two plugins are called `{kind}.{name}`"));
        problem.found(format!("`{}` and `{}`", pair[0].module_path, pair[1].module_path));
        problem.help("give one of them another name");
        problem
    })
    .collect()
}
