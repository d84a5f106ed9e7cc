//! The functions that plugins of all kinds have.

use std::ffi::c_void;

use lacuna::plugin::manual::generator;
use lacuna::plugin::{self, Component};
use lacuna::text::decode::decode;
use lacuna::text::{Complaints, Node, Place, Problems, Sources, emit};
use lacuna_abi::guard::{begin, end, guard, object};
use lacuna_abi::table::{self, Answer, ComponentFunctions, Text};
use lacuna_abi::wire::{Complaint, OwnedContext, json_of_table, node_of_json};
use lacuna_abi::{Refusal, status};
use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A plugin as its author writes it: options that serialise and a schema of them.
pub trait Authored: Component + Serialize + DeserializeOwned + JsonSchema + 'static {}

impl<T: Component + Serialize + DeserializeOwned + JsonSchema + 'static> Authored for T {}

/// A plugin of the library.
pub(super) struct Plugin<T>(pub T);

/// A kind of plugin that a library can offer, with the plugin's revision; implemented by the trait object of the kind,
/// as by `dyn Sampler`.
pub trait Export<T, const REVISION: u32> {
    /// The table of the kind's functions.
    const FUNCTIONS: *const c_void;
    /// The table of what all kinds do.
    const COMPONENT: *const ComponentFunctions;
}

macro_rules! exports {
    ($($kind:ident as $functions:ident),* $(,)?) => {
        $( impl<T: plugin::$kind + Authored, const REVISION: u32> Export<T, REVISION>
            for dyn plugin::$kind
        {
            const FUNCTIONS: *const c_void =
                std::ptr::from_ref(const { &table::$functions::of::<Plugin<T>>() }).cast();
            const COMPONENT: *const ComponentFunctions = Components::<T, REVISION>::FUNCTIONS;
        } )*
    };
}

exports! {
    Design as DesignFunctions,
    Discrepancy as DiscrepancyFunctions,
    Effect as EffectFunctions,
    Model as ModelFunctions,
    Quantity as QuantityFunctions,
    Reader as ReaderFunctions,
    Sampler as SamplerFunctions,
    Surrogate as SurrogateFunctions,
}

/// The functions of a component.
struct Components<T, const REVISION: u32>(std::marker::PhantomData<T>);

impl<T: Authored, const REVISION: u32> Components<T, REVISION> {
    const FUNCTIONS: &'static ComponentFunctions = &ComponentFunctions {
        size: size_of::<ComponentFunctions>(),
        schema: Some(schema::<T>),
        create: Some(create::<T>),
        destroy: Some(end::<Plugin<T>>),
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
        unsafe { *made = begin(Plugin(plugin)) };
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
        let Plugin(plugin) = unsafe { object::<Plugin<T>>(plugin) };
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
    look: impl Fn(&T, &lacuna::plugin::Context<'_>, &mut Complaints<'_>),
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as the caller promises.
        let (Plugin(plugin), context) = unsafe { (object::<Plugin<T>>(plugin), context.bytes()) };
        let context: OwnedContext = serde_json::from_slice(context)?;
        let (node, mut problems) = (Node::table(nowhere()), Problems::new());
        context.with(|context| look(plugin, context, &mut Complaints::new(&node, &mut problems)));
        out.json(&Complaint::all(&problems))
    })
}
