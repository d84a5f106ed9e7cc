//! Designs of a library.

use std::ffi::c_void;

use super::component::{Authored, Components, Export};
use crate::data::Parameter;
use crate::math::random::Stream;
use crate::plugin::Design;
use crate::plugin::abi::guard::{fill, guard, object};
use crate::plugin::abi::table::{Answer, ComponentFunctions, DesignFunctions, Key, Numbers, Text};

impl<T: Design + Authored, const REVISION: u32> Export<T, REVISION> for dyn Design {
    const FUNCTIONS: *const c_void = std::ptr::from_ref(Functions::<T>::TABLE).cast();
    const COMPONENT: *const ComponentFunctions = Components::<T, REVISION>::FUNCTIONS;
}

struct Functions<T>(std::marker::PhantomData<T>);

impl<T: Design + Authored> Functions<T> {
    const TABLE: &'static DesignFunctions = &DesignFunctions {
        size: size_of::<DesignFunctions>(),
        points: Some(points::<T>),
        place: Some(place::<T>),
        extend: Some(extend::<T>),
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

unsafe extern "C" fn extend<T: Design + Authored>(
    plugin: *mut c_void,
    parameters: Text,
    known: Numbers,
    count: usize,
    key: Key,
    to: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `place`; the known points are there for the time of the call.
        let (plugin, parameters, known) =
            unsafe { (object::<T>(plugin), parameters.bytes(), known.matrix()?) };
        let parameters: Vec<Parameter> = serde_json::from_slice(parameters)?;
        let points = plugin.extend(&parameters, &known, count, &Stream::from_key(key.words))?;
        // SAFETY: the buffer holds `count x parameters` numbers.
        unsafe { fill(to, count * parameters.len(), points.as_slice()) }
    })
}
