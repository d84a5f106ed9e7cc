//! Plugins that are not linked into the program, as entries of the registry.

use lacuna::plugin::Library;
use lacuna::plugin::registry::loaded::AnyEntry;
use lacuna::plugin::registry::{Built, Entry, Kind, find};
use lacuna::text::{Complaints, Node, Problems};
use schemars::{Schema, SchemaGenerator};
use toml::Table;

use crate::options::Options;
use crate::wire::Complaint;
use crate::{Refusal, status};

/// Makes an instance from a section of a study; returns it with all its options.
pub type Make<K> = dyn Fn(&Node) -> Result<(Box<K>, Table), Refusal> + Send + Sync;

/// A plugin of a loaded file, from which instances are made.
struct Offered<K: ?Sized> {
    name: &'static str,
    revision: u32,
    options: Options,
    library: &'static Library,
    make: Box<Make<K>>,
}

/// The name of a plugin in messages.
pub fn who<K: Kind + ?Sized>(name: &str, library: &Library) -> String {
    format!("{} `{name}` of {}", K::NAME, library.file())
}

/// Refuses a name that another plugin of the kind has.
///
/// # Errors
/// What is wrong, to follow the kind and the name of the plugin.
pub fn is_free<K: Kind + ?Sized>(name: &str) -> Result<(), String> {
    let Ok(other) = find::<K>(name) else { return Ok(()) };
    let (kind, path) = (K::NAME, other.module_path);
    Err(format!("has a name that is taken: `{path}` has a {kind} of that name too"))
}

/// The entry of a plugin, which lives as long as the process.
pub fn entry<K: Kind + ?Sized>(
    name: &str,
    revision: u32,
    options: Options,
    library: &'static Library,
    make: Box<Make<K>>,
) -> AnyEntry {
    let name: &'static str = Box::leak(name.to_owned().into_boxed_str());
    let offered: &'static Offered<K> =
        Box::leak(Box::new(Offered { name, revision, options, library, make }));
    let schema: &'static (dyn Fn(&mut SchemaGenerator) -> Schema + Send + Sync) =
        Box::leak(Box::new(|generator: &mut SchemaGenerator| offered.options.schema(generator)));
    let entry: &'static Entry<K> = Box::leak(Box::new(Entry {
        name,
        aliases: &[],
        schema,
        build: Box::leak(Box::new(|node: &Node, beside: &[&str], problems: &mut Problems| {
            offered.build(node, beside, problems)
        })),
        module_path: Box::leak(library.path.display().to_string().into_boxed_str()),
        version: &library.version,
        revision,
        library: Some(library),
    }));
    entry
}

impl<K: Kind + ?Sized> Offered<K> {
    fn build(&self, node: &Node, beside: &[&str], problems: &mut Problems) -> Option<Built<K>> {
        if !self.options.check(node, beside, problems) {
            return None;
        }
        match (self.make)(node) {
            Ok((plugin, options)) => {
                let (library, revision) = (Some(self.library), self.revision);
                Some(Built { name: self.name, plugin, options, library, revision })
            }
            Err(refusal) if refusal.status == status::REJECTED => {
                let complaints = &mut Complaints::new(node, problems);
                for complaint in Complaint::read(&refusal.message) {
                    complaint.report(complaints);
                }
                None
            }
            Err(refusal) => {
                let who = who::<K>(self.name, self.library);
                let message = match refusal.status {
                    status::PANIC => format!("`create` panicked: {}", refusal.message),
                    _ => refusal.message,
                };
                problems.report(Some(node.place.clone()), format!("{who}: {message}"));
                None
            }
        }
    }
}
