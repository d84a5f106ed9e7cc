//! Designs.

use super::{Key, Numbers, Text};

functions! {
    /// Places points in the unit cube.
    DesignFunctions of plugin, served by ServeDesign {
        /// Points in the open unit cube, `count x dimension`.
        must points(count: usize, dimension: usize, key: Key, points: *mut f64);
        /// Points for these parameters, a JSON list: for a design whose points depend on the laws that will map them.
        may place(parameters: Text, count: usize, dimension: usize, key: Key, points: *mut f64);
        /// `count` further points beside those of `known` (one a row), which this design placed and which stay where they
        /// are; the key is the one that placed them. `STOP` with the reason, or `ABSENT`, where it cannot go on. Since
        /// version 1.1.
        may extend(parameters: Text, known: Numbers, count: usize, key: Key, points: *mut f64);
    }
}
