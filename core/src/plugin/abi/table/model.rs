//! Models.

use std::ffi::c_void;

use super::{Answer, Numbers, Text};

record! {
    /// Evaluations that are asked of a model, which differ in their inputs and folders only.
    Calls {
        /// The size of this struct in bytes.
        size: usize,
        /// The inputs, one call a row, in the order and the units of the signature.
        inputs: Numbers,
        /// What all calls have in common, as JSON: `{"names", "units", "layout", "scenario", "study"}`.
        about: Text,
        /// A folder of each call's own for files that are kept, a JSON list of paths or `null`.
        folders: Text,
    }
}

functions! {
    /// A simulator.
    ModelFunctions {
        /// Answers what goes in and what comes out, as JSON: `{"inputs": [{"name", "unit", "default", "low", "high",
        /// "description"}], "layout", "resamples"}`. `low` and `high` are `null` where there is no bound; an answer
        /// without `inputs` or `layout` takes those of the study.
        must signature(plugin: *mut c_void, context: Text, answer: *const Answer) -> i32;
        /// Runs the simulator: `calls x outputs` into `responses`. `statuses` has one status a call (`OK`, `REJECTED`,
        /// `FATAL`), `valid` is 1 where a run stayed inside the model's range of validity. The text is a JSON list with
        /// one `{"message", "facts"}` or `null` a call, or nothing.
        must predict(plugin: *mut c_void, calls: *const Calls, responses: *mut f64, statuses: *mut i32, valid: *mut u8, answer: *const Answer) -> i32;
        /// How many evaluations are best asked for at once.
        may batch(plugin: *mut c_void) -> usize;
        /// Answers the inputs on which no response depends, a JSON list of names.
        may unused(plugin: *mut c_void, context: Text, answer: *const Answer) -> i32;
        /// Answers the user's files that the answers depend on, a JSON list of paths; relative ones start in `directory`.
        may files(plugin: *mut c_void, directory: Text, answer: *const Answer) -> i32;
        /// Writes a finished run (one call, its response, and `{"valid", "facts"}` about it) in the simulator's own format
        /// into `directory` and answers the file's name; `ABSENT` when it has no format of its own.
        may write(plugin: *mut c_void, run: Text, calls: *const Calls, response: Numbers, about: Text, directory: Text, answer: *const Answer) -> i32;
        /// The derivatives of each value of the response (rows) by each input (columns), for one call. `ABSENT` where
        /// they are not known. Without a call (no row of inputs, `jacobian` null) nothing is written: whether there are
        /// derivatives is the question.
        may jacobian(plugin: *mut c_void, calls: *const Calls, jacobian: *mut f64, answer: *const Answer) -> i32;
        /// The response of one call, as `predict` gives it, and its derivatives, as `jacobian` gives them, from one run;
        /// `ABSENT` where that costs no less than asking for each. `valid` and the text are as those of `predict` for this
        /// call. Since version 1.1.
        may with_response(plugin: *mut c_void, calls: *const Calls, response: *mut f64, jacobian: *mut f64, valid: *mut u8, answer: *const Answer) -> i32;
    }
}
