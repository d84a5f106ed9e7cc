//! The plugins of a file as entries of the registry.

use std::sync::Arc;

use lacuna::plugin::registry::loaded::AnyEntry;
use lacuna::plugin::registry::{Built, Entry, Kind, find};
use lacuna::plugin::{Discrepancy, Effect, Library, Model, Quantity, Reader, Sampler, Surrogate};
use lacuna::run::Fault;
use lacuna::text::{Complaints, Node, Problems};
use lacuna_abi::options::Options;
use lacuna_abi::wire::{Complaint, json_of_node, table_of_json};
use lacuna_abi::{Refusal, status};
use schemars::{Schema, SchemaGenerator};
use serde::Deserialize;
use serde_json::{Map, Value as Json};

use crate::object::{Object, Plugin};
use crate::script::Script;

/// A plugin as its file declares it.
#[derive(Deserialize)]
pub(crate) struct Declared {
    /// Kind of the plugin.
    pub kind: String,
    /// Name in studies.
    pub name: String,
    /// JSON Schema of its options.
    pub schema: Map<String, Json>,
    /// Optional methods that it has.
    pub has: Vec<String>,
}

/// The entry of a plugin; the error says why it cannot be one.
pub(crate) fn offer(
    declared: Declared,
    script: &Arc<Script>,
    library: &'static Library,
) -> Result<AnyEntry, String> {
    match declared.kind.as_str() {
        "discrepancy" => entry::<dyn Discrepancy>(declared, script, library, |p| Box::new(p)),
        "effect" => entry::<dyn Effect>(declared, script, library, |p| Box::new(p)),
        "model" => entry::<dyn Model>(declared, script, library, |p| Box::new(p)),
        "quantity" => entry::<dyn Quantity>(declared, script, library, |p| Box::new(p)),
        "reader" => entry::<dyn Reader>(declared, script, library, |p| Box::new(p)),
        "sampler" => entry::<dyn Sampler>(declared, script, library, |p| Box::new(p)),
        "surrogate" => entry::<dyn Surrogate>(declared, script, library, |p| Box::new(p)),
        kind => Err(format!("there are no plugins of the kind `{kind}` in Python")),
    }
}

fn entry<K: Kind + ?Sized>(
    declared: Declared,
    script: &Arc<Script>,
    library: &'static Library,
    adapt: fn(Plugin) -> Box<K>,
) -> Result<AnyEntry, String> {
    let Declared { name, schema, has, .. } = declared;
    if let Ok(other) = find::<K>(&name) {
        let (kind, path) = (K::NAME, other.module_path);
        return Err(format!(
            "its {kind} `{name}` has a name that is taken: `{path}` has a {kind} of that name too"
        ));
    }
    let options = Options::new(schema, format!("{}.{name}", K::NAME));
    let (script, has) = (script.clone(), Arc::new(has));
    let name: &'static str = Box::leak(name.into_boxed_str());
    let offered: &'static Offered<K> =
        Box::leak(Box::new(Offered { name, options, has, script, library, adapt }));
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
        revision: 1,
        library: Some(library),
    }));
    Ok(entry)
}

/// A plugin of a file, from which instances are made.
struct Offered<K: ?Sized> {
    name: &'static str,
    options: Options,
    has: Arc<Vec<String>>,
    script: Arc<Script>,
    library: &'static Library,
    adapt: fn(Plugin) -> Box<K>,
}

impl<K: Kind + ?Sized> Offered<K> {
    fn build(&self, node: &Node, beside: &[&str], problems: &mut Problems) -> Option<Built<K>> {
        if !self.options.check(node, beside, problems) {
            return None;
        }
        match self.made(node) {
            Ok((plugin, options)) => {
                let (plugin, library) = ((self.adapt)(plugin), Some(self.library));
                Some(Built { name: self.name, plugin, options, library, revision: 1 })
            }
            Err(refusal) if refusal.status == status::REJECTED => {
                let complaints = &mut Complaints::new(node, problems);
                for complaint in Complaint::read(&refusal.message) {
                    complaint.report(complaints);
                }
                None
            }
            Err(refusal) => {
                let message = format!("{}: {}", self.who(), refusal.message);
                problems.report(Some(node.place.clone()), message);
                None
            }
        }
    }

    fn made(&self, node: &Node) -> Result<(Plugin, toml::Table), Refusal> {
        let (fault, given) = (Arc::new(Fault::new(self.who())), json_of_node(node));
        let (object, options) =
            Object::new(&self.script, (K::NAME, self.name), given, self.has.clone(), fault)?;
        let Json::Object(options) = options else {
            return Err(Refusal::stop("its options are no table"));
        };
        Ok((Plugin(object), table_of_json(&options)))
    }

    fn who(&self) -> String {
        format!("{} `{}` of {}", K::NAME, self.name, self.library.file())
    }
}
