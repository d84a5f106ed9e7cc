//! The plugins of a library as entries of the registry.

use std::sync::Arc;

use lacuna::plugin::registry::Kind;
use lacuna::plugin::registry::loaded::AnyEntry;
use lacuna::plugin::{
    Design, Discrepancy, Effect, Library, Model, Quantity, Reader, Sampler, Surrogate,
};
use lacuna::run::Fault;
use lacuna::text::Node;
use lacuna_abi::offered;
use lacuna_abi::options::Options;
use lacuna_abi::record::is_word;
use lacuna_abi::table::{
    ComponentFunctions, DesignFunctions, DiscrepancyFunctions, EffectFunctions, Entry as Raw,
    ModelFunctions, QuantityFunctions, ReaderFunctions, SamplerFunctions, SurrogateFunctions,
    Table, Text, copied,
};
use lacuna_abi::wire::{json_of_node, table_of_json};
use lacuna_abi::{Object, Refusal, Reply, watch};
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
    offered::is_free::<K>(name)?;
    // SAFETY: as the caller promises.
    let (functions, component) =
        unsafe { (copied::<F>(raw.functions.cast()), copied(raw.component)) };
    let said = |refusal: Refusal| refusal.message;
    let (functions, component) = (functions.map_err(said)?, component.map_err(said)?);
    let revision = revision(&component).map_err(said)?;
    let options = Options::new(schema(&component).map_err(said)?, format!("{}.{name}", K::NAME));
    let who = offered::who::<K>(name, library);
    let make = Box::new(move |node: &Node| {
        let plugin = made(node, functions, component, &who)?;
        let options = written(&plugin, node)?;
        Ok((adapt(plugin), options))
    });
    Ok(offered::entry::<K>(name, revision, options, library, make))
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

/// An instance of a plugin that messages call `who`.
fn made<F: Table>(
    node: &Node,
    functions: F,
    component: ComponentFunctions,
    who: &str,
) -> Result<Plugin<F>, Refusal> {
    let Some(create) = component.create else { return Err(Refusal::absent()) };
    let options = json_of_node(node).to_string();
    let mut this = std::ptr::null_mut();
    let to = &raw mut this;
    // SAFETY: the function belongs to a library that stays; text and place are there until it returns.
    let call = |answer| unsafe { create(Text::of(&options), to, answer) };
    watch::inside(who, || Reply::of("create", call))?;
    if this.is_null() {
        return Err(Refusal::stop("`create` makes nothing"));
    }
    let fault = Arc::new(Fault::new(who));
    let object = Object::new(this, functions, component.destroy, fault);
    Ok(Plugin::new(object, component))
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
