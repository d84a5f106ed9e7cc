//! Effects of a library.

use std::ffi::c_void;

use super::component::{Authored, Components, Export};
use crate::data::Layout;
use crate::linalg::Matrix;
use crate::plugin::Effect;
use crate::plugin::abi::guard::{fill, guard, object};
use crate::plugin::abi::table::{Answer, ComponentFunctions, EffectFunctions, Numbers, Text};
use crate::plugin::abi::wire::{EffectAbout, OwnedSituation, json_of_table};
use crate::plugin::abi::{Memo, Refusal};

impl<T: Effect + Authored, const REVISION: u32> Export<T, REVISION> for dyn Effect {
    const FUNCTIONS: *const c_void = std::ptr::from_ref(Functions::<T>::TABLE).cast();
    const COMPONENT: *const ComponentFunctions = Components::<T, REVISION>::FUNCTIONS;
}

struct Functions<T>(std::marker::PhantomData<T>);

impl<T: Effect + Authored> Functions<T> {
    const TABLE: &'static EffectFunctions = &EffectFunctions {
        size: size_of::<EffectFunctions>(),
        describe: Some(describe::<T>),
        parameters: Some(parameters::<T>),
        absent: Some(absent::<T>),
        apply: Some(apply::<T>),
        starts: Some(starts::<T>),
        by_parameters: Some(by_parameters::<T>),
        push_forward: Some(push_forward::<T>),
        proposals: Some(proposals::<T>),
    };
}

/// The layouts that were read last: the same few come with every call.
static LAYOUTS: Memo<String, Layout> = Memo::new();

/// A layout from its JSON.
///
/// # Safety
/// The text is there.
unsafe fn layout(text: Text) -> Result<std::sync::Arc<Layout>, Refusal> {
    // SAFETY: as the caller promises.
    let bytes = unsafe { text.bytes() };
    let known = |text: &String| text.as_bytes() == bytes;
    LAYOUTS.get(known, || {
        Ok((String::from_utf8_lossy(bytes).into_owned(), serde_json::from_slice(bytes)?))
    })
}

unsafe extern "C" fn describe<T: Effect + Authored>(
    plugin: *mut c_void,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: the plugin that `create` made.
        let plugin = unsafe { object::<T>(plugin) };
        out.json(&EffectAbout::new(plugin.describe(), plugin.reach()))
    })
}

unsafe extern "C" fn parameters<T: Effect + Authored>(
    plugin: *mut c_void,
    text: Text,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: the plugin that `create` made, and a text that is there for the time of the call.
        let (plugin, layout) = unsafe { (object::<T>(plugin), layout(text)?) };
        out.json(&plugin.parameters(&layout))
    })
}

unsafe extern "C" fn absent<T: Effect + Authored>(
    plugin: *mut c_void,
    text: Text,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `parameters`.
        let (plugin, layout) = unsafe { (object::<T>(plugin), layout(text)?) };
        out.row(&plugin.absent(&layout));
        Ok(())
    })
}

unsafe extern "C" fn apply<T: Effect + Authored>(
    plugin: *mut c_void,
    text: Text,
    responses: Numbers,
    values: Numbers,
    changed: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `parameters`; the numbers are there for the time of the call.
        let (plugin, layout) = unsafe { (object::<T>(plugin), layout(text)?) };
        // SAFETY: as above.
        let (responses, values) = unsafe { (responses.matrix()?, values.matrix()?) };
        let rows = responses.iter_rows().zip(values.iter_rows());
        let all: Vec<f64> = rows.flat_map(|(y, values)| plugin.apply(&layout, y, values)).collect();
        // SAFETY: the buffer is as large as the responses.
        unsafe { fill(changed, responses.as_slice().len(), &all) }
    })
}

unsafe extern "C" fn by_parameters<T: Effect + Authored>(
    plugin: *mut c_void,
    text: Text,
    response: Numbers,
    values: Numbers,
    jacobian: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `apply`.
        let (plugin, layout) = unsafe { (object::<T>(plugin), layout(text)?) };
        // SAFETY: as above.
        let (response, values) = unsafe { (response.slice()?, values.slice()?) };
        let slopes = plugin.by_parameters(&layout, response, values);
        // SAFETY: the buffer holds `outputs x parameters` numbers.
        unsafe { fill(jacobian, response.len() * values.len(), slopes.as_slice()) }
    })
}

unsafe extern "C" fn push_forward<T: Effect + Authored>(
    plugin: *mut c_void,
    text: Text,
    response: Numbers,
    values: Numbers,
    tangents: Numbers,
    changed: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `apply`.
        let (plugin, layout) = unsafe { (object::<T>(plugin), layout(text)?) };
        // SAFETY: as above.
        let (response, values, tangents) =
            unsafe { (response.slice()?, values.slice()?, tangents.matrix()?) };
        let one = |tangent| plugin.push_forward(&layout, response, values, tangent);
        let all: Vec<f64> = tangents.iter_rows().flat_map(one).collect();
        // SAFETY: the buffer is as large as the tangents.
        unsafe { fill(changed, tangents.as_slice().len(), &all) }
    })
}

unsafe extern "C" fn starts<T: Effect + Authored>(
    plugin: *mut c_void,
    text: Text,
    situation: Text,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `parameters`.
        let (plugin, layout) = unsafe { (object::<T>(plugin), layout(text)?) };
        // SAFETY: as above.
        let situation: OwnedSituation = serde_json::from_slice(unsafe { situation.bytes() })?;
        let starts = plugin.starts(&layout, &situation.view());
        let columns = plugin.parameters(&layout).len();
        out.numbers(&Matrix::from_rows(columns, starts));
        Ok(())
    })
}

unsafe extern "C" fn proposals<T: Effect + Authored>(
    plugin: *mut c_void,
    situation: Text,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `parameters`.
        let (plugin, situation) = unsafe { (object::<T>(plugin), situation.bytes()) };
        let situation: OwnedSituation = serde_json::from_slice(situation)?;
        let all = plugin.proposals(&situation.view());
        out.json(&all.iter().map(json_of_table).collect::<Vec<_>>())
    })
}
