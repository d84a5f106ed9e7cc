//! The functions that plugins of all kinds have.

use std::ffi::c_void;

use super::{Answer, Text};

functions! {
    /// The functions of plugins of all kinds: they are made from options, and check themselves.
    ComponentFunctions {
        /// Answers the JSON Schema (2020-12) of the options: an object with `properties`, each with a `description`, and
        /// `required`. With `"additionalProperties": false` keys that it does not list are refused before `create`.
        must schema(answer: *const Answer) -> i32;
        /// Makes a plugin from its options, a JSON object, and puts it into `out`. Options that are wrong are
        /// `REJECTED`, with the reason as text, or with a JSON list of complaints
        /// `{"at": "degree.max", "message": "…", "expected": "…", "found": "…", "help": ["…"]}`.
        /// A number that is not finite is written `{"float": "inf"}`, `"-inf"` or `"nan"`.
        must create(options: Text, out: *mut *mut c_void, answer: *const Answer) -> i32;
        /// Ends a plugin.
        must destroy(plugin: *mut c_void);
        /// Answers all options with the defaults filled in, a JSON object; as they were given where it is null.
        may options(plugin: *mut c_void, answer: *const Answer) -> i32;
        /// Checks the options against the rest of the study and answers a JSON list of complaints; none when it
        /// writes nothing. `context` is described in `docs/abi.md`. No files are touched.
        may check(plugin: *mut c_void, context: Text, answer: *const Answer) -> i32;
        /// Checks the options against the machine: files, commands. Nothing is changed.
        may environment(plugin: *mut c_void, context: Text, answer: *const Answer) -> i32;
        /// The revision of the plugin, a number from 1 that its author raises whenever what it computes changes; 1 where
        /// it is null. Since version 1.1.
        may revision() -> u32;
    }
}
