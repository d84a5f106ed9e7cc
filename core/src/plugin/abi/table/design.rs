//! Designs.

use std::ffi::c_void;

use super::{Answer, Key, Text};

functions! {
    /// Places points in the unit cube.
    DesignFunctions {
        /// Points in the open unit cube, `count x dimension`.
        must points(plugin: *mut c_void, count: usize, dimension: usize, key: Key, points: *mut f64, answer: *const Answer) -> i32;
        /// Points for these parameters, a JSON list: for a design whose points depend on the laws that will map them.
        may place(plugin: *mut c_void, parameters: Text, count: usize, dimension: usize, key: Key, points: *mut f64, answer: *const Answer) -> i32;
    }
}
