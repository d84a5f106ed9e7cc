//! Designs.

use std::ffi::c_void;

use super::{Answer, Key, Numbers, Text};

functions! {
    /// Places points in the unit cube.
    DesignFunctions {
        /// Points in the open unit cube, `count x dimension`.
        must points(plugin: *mut c_void, count: usize, dimension: usize, key: Key, points: *mut f64, answer: *const Answer) -> i32;
        /// Points for these parameters, a JSON list: for a design whose points depend on the laws that will map them.
        may place(plugin: *mut c_void, parameters: Text, count: usize, dimension: usize, key: Key, points: *mut f64, answer: *const Answer) -> i32;
        /// `count` further points beside those of `known` (one a row), which this design placed and which stay where they
        /// are; the key is the one that placed them. `STOP` with the reason, or `ABSENT`, where it cannot go on. Since
        /// version 1.1.
        may extend(plugin: *mut c_void, parameters: Text, known: Numbers, count: usize, key: Key, points: *mut f64, answer: *const Answer) -> i32;
    }
}
