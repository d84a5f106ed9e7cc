//! What plugins of all kinds do.

use std::ffi::c_void;

use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::plugin::Component;
use crate::plugin::abi::Refusal;
use crate::plugin::abi::guard::{begin, end, guard, object};
use crate::plugin::abi::table::{Answer, ComponentFunctions, Text, status};
use crate::plugin::abi::wire::{Complaint, OwnedContext, json_of_table, node_of_json};
use crate::plugin::manual::generator;
use crate::study::decode::decode;
use crate::study::{Complaints, Node, Place, Problems, Sources, emit};

/// A plugin as its author writes it: options that serialise and a schema of them.
pub trait Authored: Component + Serialize + DeserializeOwned + JsonSchema + 'static {}

impl<T: Component + Serialize + DeserializeOwned + JsonSchema + 'static> Authored for T {}

/// A kind of plugin that a library can offer, with the plugin's revision; implemented by the trait object of the kind,
/// as by `dyn Sampler`.
pub trait Export<T, const REVISION: u32> {
    /// The table of the kind's functions.
    const FUNCTIONS: *const c_void;
    /// The table of what all kinds do.
    const COMPONENT: *const ComponentFunctions;
}

/// The functions of a component.
pub(super) struct Components<T, const REVISION: u32>(std::marker::PhantomData<T>);

impl<T: Authored, const REVISION: u32> Components<T, REVISION> {
    pub(super) const FUNCTIONS: &'static ComponentFunctions = &ComponentFunctions {
        size: size_of::<ComponentFunctions>(),
        schema: Some(schema::<T>),
        create: Some(create::<T>),
        destroy: Some(end::<T>),
        options: Some(options::<T>),
        check: Some(check::<T>),
        environment: Some(environment::<T>),
        revision: Some(revision::<REVISION>),
    };
}

unsafe extern "C" fn revision<const REVISION: u32>() -> u32 {
    REVISION
}

unsafe extern "C" fn schema<T: Authored>(answer: *const Answer) -> i32 {
    guard(answer, |out| {
        let mut generator = generator();
        let schema = generator.subschema_for::<T>();
        let mut whole = schema.to_value();
        if let Some(object) = whole.as_object_mut() {
            object.insert("$defs".to_owned(), generator.take_definitions(false).into());
        }
        out.json(&whole)
    })
}

unsafe extern "C" fn create<T: Authored>(
    options: Text,
    made: *mut *mut c_void,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: the text is there for the time of the call.
        let json = serde_json::from_slice(unsafe { options.bytes() })?;
        let (place, mut problems) = (nowhere(), Problems::new());
        let node = node_of_json(&json, &place).unwrap_or_else(|| Node::table(place));
        let Some(plugin) = decode::<T>(&node, &mut problems) else {
            let complaints = serde_json::to_string(&Complaint::all(&problems))?;
            return Err(Refusal::new(status::REJECTED, complaints));
        };
        // SAFETY: the caller gives a place for one pointer.
        unsafe { *made = begin(plugin) };
        Ok(())
    })
}

/// A place for values that stand in no file.
fn nowhere() -> Place {
    Place::whole(Sources::default().add_argument("options", String::new()))
}

unsafe extern "C" fn options<T: Authored>(plugin: *mut c_void, answer: *const Answer) -> i32 {
    guard(answer, |out| {
        // SAFETY: the plugin that `create` made.
        let plugin = unsafe { object::<T>(plugin) };
        let table =
            emit::to_table(plugin).map_err(|e| Refusal::stop(format!("the options {e}")))?;
        out.json(&json_of_table(&table))
    })
}

unsafe extern "C" fn check<T: Authored>(
    plugin: *mut c_void,
    context: Text,
    answer: *const Answer,
) -> i32 {
    // SAFETY: as this function's caller promises.
    unsafe { complain::<T>(plugin, context, answer, Component::check) }
}

unsafe extern "C" fn environment<T: Authored>(
    plugin: *mut c_void,
    context: Text,
    answer: *const Answer,
) -> i32 {
    // SAFETY: as this function's caller promises.
    unsafe { complain::<T>(plugin, context, answer, Component::environment) }
}

/// Answers what a check complains of.
///
/// # Safety
/// The plugin is one that `create` made, and the text is there for the time of the call.
unsafe fn complain<T: Authored>(
    plugin: *mut c_void,
    context: Text,
    answer: *const Answer,
    look: impl Fn(&T, &crate::plugin::Context<'_>, &mut Complaints<'_>),
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as the caller promises.
        let (plugin, context) = unsafe { (object::<T>(plugin), context.bytes()) };
        let context: OwnedContext = serde_json::from_slice(context)?;
        let (node, mut problems) = (Node::table(nowhere()), Problems::new());
        context.with(|context| look(plugin, context, &mut Complaints::new(&node, &mut problems)));
        out.json(&Complaint::all(&problems))
    })
}
