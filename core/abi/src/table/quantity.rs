//! Quantities of interest.

use std::ffi::c_void;

use super::{Numbers, Text};

functions! {
    /// A quantity that is ready to be computed.
    FunctionalFunctions of functional ended by destroy, served by ServeFunctional {
        /// Answers the unit of the value: a text as in a study, `1` for a number without unit.
        must unit();
        /// The value for each row of `arguments`: the values of a curve, or named numbers; NaN where the quantity is undefined.
        must value(arguments: Numbers, values: *mut f64);
    }
}

record! {
    /// A quantity as a function of certain arguments.
    Functional {
        /// The size of this struct in bytes.
        size: usize,
        /// The first argument of the functions.
        functional: *mut c_void,
        /// The functions.
        functions: *const FunctionalFunctions,
    }
}

functions! {
    /// A number that follows from one curve of the response, or from named numbers of a study. Since version 1.2.
    QuantityFunctions of plugin, served by ServeQuantity {
        /// Writes 1 for a quantity of a curve, 0 for one of named numbers.
        must of_curve(of_curve: *mut u8);
        /// The quantity as a function of arguments, which are described as JSON:
        /// `{"curve": {"name", "unit", "axis", "grid", "grid_unit"}}` or `{"numbers": [{"name", "unit"}]}`. `REJECTED` with
        /// complaints as from `create` where the options do not fit the arguments.
        must bind(arguments: Text, out: *mut Functional);
    }
}
