//! Models.

use super::{Numbers, Text};

record! {
    /// Evaluations that are asked of a model, which differ in their inputs and folders only.
    Calls {
        /// The size of this struct in bytes.
        size: usize,
        /// The inputs, one call a row, in the order and the units of the signature.
        inputs: Numbers,
        /// The properties that all calls have in common, as JSON: `{"names", "units", "layout", "scenario", "study"}`.
        about: Text,
        /// A folder of each call's own for files that are kept, a JSON list of paths or `null`.
        folders: Text,
    }
}

functions! {
    /// A simulator.
    ModelFunctions of plugin, served by ServeModel {
        /// Answers what goes in and what comes out, as JSON:
        /// `{"inputs": [{"name", "unit", "default", "low", "high", "description"}], "layout", "resamples"}`. `low` and
        /// `high` are `null` where there is no bound; an answer without `inputs` or `layout` takes those of the study.
        must signature(context: Text);
        /// Runs the simulator: `calls x outputs` into `responses`. `statuses` has one status a call (`OK`, `REJECTED`,
        /// `FATAL`), `valid` is 1 where a run stayed inside the model's range of validity. The text is a JSON list with
        /// one `{"message", "facts"}` or `null` a call, or nothing.
        must predict(calls: *const Calls, responses: *mut f64, statuses: *mut i32, valid: *mut u8);
        /// The number of evaluations that are best asked for at once.
        may batch() -> usize;
        /// Answers the inputs on which no response depends, a JSON list of names.
        may unused(context: Text);
        /// Answers the user's files that the answers depend on, a JSON list of paths; relative ones start in `directory`.
        may files(directory: Text);
        /// Writes a finished run (one call, its response, and `{"valid", "facts"}` about it) in the simulator's own format
        /// into `directory` and answers the file's name; `ABSENT` when it has no format of its own.
        may write(run: Text, calls: *const Calls, response: Numbers, about: Text, directory: Text);
        /// The derivatives of each value of the response (rows) by each input (columns), for one call. `ABSENT` where
        /// they are not known. Without a call (no row of inputs, `jacobian` null) nothing is written: whether there are
        /// derivatives is the question.
        may jacobian(calls: *const Calls, jacobian: *mut f64);
        /// The response of one call, as `predict` gives it, and its derivatives, as `jacobian` gives them, from one run;
        /// `ABSENT` where that costs no less than asking for each. `valid` and the text are as those of `predict` for this
        /// call. Since version 1.1.
        may with_response(calls: *const Calls, response: *mut f64, jacobian: *mut f64, valid: *mut u8);
    }
}
