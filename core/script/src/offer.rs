//! The plugins of a file as entries of the registry.

use std::sync::Arc;

use lacuna::plugin::registry::Kind;
use lacuna::plugin::registry::loaded::AnyEntry;
use lacuna::plugin::{Discrepancy, Effect, Library, Model, Quantity, Reader, Sampler, Surrogate};
use lacuna::run::Fault;
use lacuna::text::Node;
use lacuna_abi::Refusal;
use lacuna_abi::offered;
use lacuna_abi::options::Options;
use lacuna_abi::wire::{json_of_node, table_of_json};
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
    let named = |message: String| format!("its {} `{name}` {message}", K::NAME);
    offered::is_free::<K>(&name).map_err(named)?;
    let options = Options::new(schema, format!("{}.{name}", K::NAME));
    let (script, has, who) = (script.clone(), Arc::new(has), offered::who::<K>(&name, library));
    let called = name.clone();
    let make = Box::new(move |node: &Node| {
        let (fault, given) = (Arc::new(Fault::new(&*who)), json_of_node(node));
        let (object, options) =
            Object::new(&script, (K::NAME, &called), given, has.clone(), fault)?;
        let Json::Object(options) = options else {
            return Err(Refusal::stop("its options are no table"));
        };
        Ok((adapt(Plugin(object)), table_of_json(&options)))
    });
    Ok(offered::entry::<K>(&name, 1, options, library, make))
}
