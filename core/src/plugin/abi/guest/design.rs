//! Designs of a library.

use std::ffi::c_void;

use super::component::{Authored, Components, Export};
use crate::data::Parameter;
use crate::math::random::Stream;
use crate::plugin::Design;
use crate::plugin::abi::guard::{fill, guard, object};
use crate::plugin::abi::table::{Answer, ComponentFunctions, DesignFunctions, Key, Text};

impl<T: Design + Authored> Export<T> for dyn Design {
    const FUNCTIONS: *const c_void = std::ptr::from_ref(Functions::<T>::TABLE).cast();
    const COMPONENT: *const ComponentFunctions = Components::<T>::FUNCTIONS;
}

struct Functions<T>(std::marker::PhantomData<T>);

impl<T: Design + Authored> Functions<T> {
    const TABLE: &'static DesignFunctions = &DesignFunctions {
        size: size_of::<DesignFunctions>(),
        points: Some(points::<T>),
        place: Some(place::<T>),
    };
}

unsafe extern "C" fn points<T: Design + Authored>(
    plugin: *mut c_void,
    count: usize,
    dimension: usize,
    key: Key,
    to: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: the plugin that `create` made.
        let plugin = unsafe { object::<T>(plugin) };
        let points = plugin.points(count, dimension, &Stream::from_key(key.words))?;
        // SAFETY: the buffer holds `count x dimension` numbers.
        unsafe { fill(to, count * dimension, points.as_slice()) }
    })
}

unsafe extern "C" fn place<T: Design + Authored>(
    plugin: *mut c_void,
    parameters: Text,
    count: usize,
    dimension: usize,
    key: Key,
    to: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `points`; the text is there for the time of the call.
        let (plugin, parameters) = unsafe { (object::<T>(plugin), parameters.bytes()) };
        let parameters: Vec<Parameter> = serde_json::from_slice(parameters)?;
        let points = plugin.place(&parameters, count, &Stream::from_key(key.words))?;
        // SAFETY: the buffer holds `count x dimension` numbers.
        unsafe { fill(to, count * dimension, points.as_slice()) }
    })
}
