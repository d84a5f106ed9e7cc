//! The plugins of a library as entries of the registry.

use std::sync::Arc;

use lacuna::plugin::registry::loaded::AnyEntry;
use lacuna::plugin::registry::{Built, Entry, Kind, find};
use lacuna::plugin::{
    Design, Discrepancy, Effect, Library, Model, Quantity, Reader, Sampler, Surrogate,
};
use lacuna::run::Fault;
use lacuna::text::{Complaints, Node, Problems};
use lacuna_abi::options::Options;
use lacuna_abi::record::is_word;
use lacuna_abi::table::{
    ComponentFunctions, DesignFunctions, DiscrepancyFunctions, EffectFunctions, Entry as Raw,
    ModelFunctions, QuantityFunctions, ReaderFunctions, SamplerFunctions, SurrogateFunctions,
    Table, Text, copied,
};
use lacuna_abi::wire::{Complaint, json_of_node, table_of_json};
use lacuna_abi::{Object, Refusal, Reply, status, watch};
use schemars::{Schema, SchemaGenerator};
use serde_json::{Map, Value as Json};

use super::Plugin;

/// Checks all plugins of a library and makes entries of them; none when one of them is wrong.
///
/// # Safety
/// The entries are constants of a library that stays.
pub unsafe fn offers(entries: &[Raw], library: &'static Library) -> Result<Vec<AnyEntry>, String> {
    let mut all = Vec::with_capacity(entries.len());
    for (i, (raw, (kind, name))) in entries.iter().zip(&library.plugins).enumerate() {
        if !is_word(name) {
            return Err(format!(
                "`{name}` is no name for a plugin: expected small letters, digits and `_`"
            ));
        }
        if library.plugins[..i].contains(&library.plugins[i]) {
            return Err(format!("it holds two plugins `{kind}.{name}`"));
        }
        let named = |message: String| format!("its {kind} `{name}` {message}");
        // SAFETY: as the caller promises, and the kind says of what type the functions are.
        let offered = unsafe { of_kind(kind, name, raw, library) };
        all.push(offered.map_err(named)?);
    }
    Ok(all)
}

/// The entry of a plugin of some kind.
///
/// # Safety
/// As for [`offers`].
unsafe fn of_kind(
    kind: &str,
    name: &str,
    raw: &Raw,
    library: &'static Library,
) -> Result<AnyEntry, String> {
    // SAFETY: as the caller promises.
    unsafe {
        match kind {
            "design" => offer::<dyn Design, DesignFunctions>(name, raw, library, |p| Box::new(p)),
            "discrepancy" => {
                offer::<dyn Discrepancy, DiscrepancyFunctions>(name, raw, library, |p| Box::new(p))
            }
            "effect" => offer::<dyn Effect, EffectFunctions>(name, raw, library, |p| Box::new(p)),
            "model" => offer::<dyn Model, ModelFunctions>(name, raw, library, |p| Box::new(p)),
            "quantity" => {
                offer::<dyn Quantity, QuantityFunctions>(name, raw, library, |p| Box::new(p))
            }
            "reader" => offer::<dyn Reader, ReaderFunctions>(name, raw, library, |p| Box::new(p)),
            "sampler" => {
                offer::<dyn Sampler, SamplerFunctions>(name, raw, library, |p| Box::new(p))
            }
            "surrogate" => {
                offer::<dyn Surrogate, SurrogateFunctions>(name, raw, library, |p| Box::new(p))
            }
            _ => Err("is of a kind that libraries cannot hold".to_owned()),
        }
    }
}

/// The entry of a plugin whose functions are of type `F`.
///
/// # Safety
/// As for [`offers`]; the functions are of that type.
unsafe fn offer<K: Kind + ?Sized, F: Table + Send + Sync + 'static>(
    name: &str,
    raw: &Raw,
    library: &'static Library,
    adapt: fn(Plugin<F>) -> Box<K>,
) -> Result<AnyEntry, String> {
    if let Ok(other) = find::<K>(name) {
        return Err(format!(
            "has a name that is taken: `{}` has a {} of that name too",
            other.module_path,
            K::NAME
        ));
    }
    // SAFETY: as the caller promises.
    let (functions, component) =
        unsafe { (copied::<F>(raw.functions.cast()), copied(raw.component)) };
    let said = |refusal: Refusal| refusal.message;
    let (functions, component) = (functions.map_err(said)?, component.map_err(said)?);
    let revision = revision(&component).map_err(said)?;
    let options = Options::new(schema(&component).map_err(said)?, format!("{}.{name}", K::NAME));
    let name: &'static str = Box::leak(name.to_owned().into_boxed_str());
    let offered: &'static Offered<K, F> = Box::leak(Box::new(Offered {
        name,
        functions,
        component,
        revision,
        options,
        library,
        adapt,
    }));
    let path: &'static str = Box::leak(library.path.display().to_string().into_boxed_str());
    let schema: &'static (dyn Fn(&mut SchemaGenerator) -> Schema + Send + Sync) =
        Box::leak(Box::new(|generator: &mut SchemaGenerator| offered.options.schema(generator)));
    let entry: &'static Entry<K> = Box::leak(Box::new(Entry {
        name,
        aliases: &[],
        schema,
        build: Box::leak(Box::new(|node: &Node, beside: &[&str], problems: &mut Problems| {
            offered.build(node, beside, problems)
        })),
        module_path: path,
        version: &library.version,
        revision,
        library: Some(library),
    }));
    Ok(entry)
}

/// The revision of a plugin; 1 where it does not say.
fn revision(component: &ComponentFunctions) -> Result<u32, Refusal> {
    // SAFETY: the function belongs to a library that stays, and is given nothing.
    match component.revision.map_or(1, |revision| unsafe { revision() }) {
        0 => Err(Refusal::stop("has the revision 0, expected a number from 1")),
        revision => Ok(revision),
    }
}

/// The schema that a plugin gives of its options.
fn schema(component: &ComponentFunctions) -> Result<Map<String, Json>, Refusal> {
    let Some(ask) = component.schema else { return Ok(Map::new()) };
    // SAFETY: the function belongs to a library that stays.
    let reply = Reply::of("schema", |answer| unsafe { ask(answer) }).map_err(|refusal| {
        Refusal::stop(format!("does not tell its options: {}", refusal.message))
    })?;
    reply.json().map_err(|refusal| {
        Refusal::stop(format!("gives a schema of its options that is none: {}", refusal.message))
    })
}

/// A plugin of a library, from which instances are made.
struct Offered<K: ?Sized, F> {
    name: &'static str,
    functions: F,
    component: ComponentFunctions,
    revision: u32,
    options: Options,
    library: &'static Library,
    adapt: fn(Plugin<F>) -> Box<K>,
}

impl<K: Kind + ?Sized, F: Table> Offered<K, F> {
    fn build(&self, node: &Node, beside: &[&str], problems: &mut Problems) -> Option<Built<K>> {
        if !self.options.check(node, beside, problems) {
            return None;
        }
        let made = self.made(node).and_then(|plugin| Ok((written(&plugin, node)?, plugin)));
        match made {
            Ok((options, plugin)) => {
                let plugin = (self.adapt)(plugin);
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
                let message = match refusal.status {
                    status::PANIC => format!("`create` panicked: {}", refusal.message),
                    _ => refusal.message,
                };
                problems.report(Some(node.place.clone()), format!("{}: {message}", self.who()));
                None
            }
        }
    }

    fn who(&self) -> String {
        format!("{} `{}` of {}", K::NAME, self.name, self.library.file())
    }

    fn made(&self, node: &Node) -> Result<Plugin<F>, Refusal> {
        let Some(create) = self.component.create else { return Err(Refusal::absent()) };
        let options = json_of_node(node).to_string();
        let mut this = std::ptr::null_mut();
        let to = &raw mut this;
        let who = self.who();
        // SAFETY: the function belongs to a library that stays; text and place are there until it returns.
        let call = |answer| unsafe { create(Text::of(&options), to, answer) };
        watch::inside(&who, || Reply::of("create", call))?;
        if this.is_null() {
            return Err(Refusal::stop("`create` makes nothing"));
        }
        let fault = Arc::new(Fault::new(self.who()));
        let object = Object::new(this, self.functions, self.component.destroy, fault);
        Ok(Plugin::new(object, self.component))
    }
}

/// All options with their defaults.
fn written<F>(plugin: &Plugin<F>, node: &Node) -> Result<toml::Table, Refusal> {
    let json = match plugin.options()? {
        Some(reply) => reply.json()?,
        None => json_of_node(node),
    };
    match json {
        Json::Object(object) => Ok(table_of_json(&object)),
        _ => Err(Refusal::stop("`options` answers no JSON object")),
    }
}
