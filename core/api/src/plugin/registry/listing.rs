//! Plugins of every kind, as data.

use lacuna_base::text::Problem;

use super::{Entry, Kind, entries, find, inventory};
use crate::plugin::Library;
use crate::plugin::manual::Manual;

/// One kind of plugin, as data.
pub struct KindEntry {
    /// Name of the kind.
    pub name: &'static str,
    /// Sections of a study that choose a plugin of this kind.
    pub sections: &'static [&'static str],
    list: fn() -> Vec<Listing>,
}

inventory::collect!(KindEntry);

/// One plugin, as data.
#[derive(Clone, Copy)]
pub struct Listing {
    /// Name of the kind.
    pub kind: &'static str,
    /// Name of the plugin in a study.
    pub name: &'static str,
    /// Module of the plugin.
    pub module_path: &'static str,
    /// Version of the package or library.
    pub version: &'static str,
    /// Revision, raised whenever the results of the plugin change.
    pub revision: u32,
    /// Library from which the plugin was loaded; `None` for a built-in plugin.
    pub library: Option<&'static Library>,
    /// Function that returns the manual page.
    pub documentation: fn(&str) -> Option<Manual>,
}

impl Listing {
    /// Manual page of the plugin.
    pub fn manual(&self) -> Option<Manual> {
        (self.documentation)(self.name)
    }
}

impl KindEntry {
    /// The kind that belongs to a trait object.
    pub const fn of<K: Kind + ?Sized>() -> Self {
        Self { name: K::NAME, sections: K::SECTIONS, list: list::<K> }
    }

    /// All plugins of the kind, sorted by name.
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

/// All kinds of plugins, sorted by name.
pub fn kinds() -> Vec<&'static KindEntry> {
    let mut kinds: Vec<&KindEntry> = inventory::iter::<KindEntry>.into_iter().collect();
    kinds.sort_by_key(|kind| kind.name);
    kinds
}

/// Reports names that two plugins of a kind share.
pub fn audit() -> Vec<Problem> {
    kinds().into_iter().flat_map(|kind| duplicates(&kind.plugins())).collect()
}

/// Problems for neighbours with equal names in a sorted list.
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
