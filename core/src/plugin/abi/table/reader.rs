//! Readers.

use std::ffi::c_void;

use super::{Answer, Text};

functions! {
    /// Reads files of one family of formats. Errors that are `REJECTED` may be the JSON object
    /// `{"path", "place", "message", "help"}`.
    ReaderFunctions {
        /// 1 where it understands a file, judged by its first bytes (at most 4096) and its name.
        must recognises(plugin: *mut c_void, path: Text, head: Text) -> i32;
        /// Answers what is in a file, as JSON: `{"format", "facts": [["…", "…"]], "variables": [{"name", "on", "axes", "unit",
        /// "range", "not_finite", "columns": [{"name", "unit"}]}]}`, and for each variable a matrix with its columns.
        must inspect(plugin: *mut c_void, path: Text, answer: *const Answer) -> i32;
        /// 1 where the options name files of the user's own.
        must names_files(plugin: *mut c_void) -> i32;
        /// Answers the files that the options name, a JSON list of paths; `source` is `{"directory", "scenario"}`.
        must files(plugin: *mut c_void, source: Text, answer: *const Answer) -> i32;
        /// Answers simulation runs: a matrix of parameters and one of responses, one run a row, and the JSON object
        /// `{"runs": ["…"], "valid": [true], "failed": [{"run", "reason"}]}`. `source` is `{"directory", "simulated", "parameters", "scenario", "layout"}`.
        may ensemble(plugin: *mut c_void, source: Text, answer: *const Answer) -> i32;
        /// Answers measurements: a matrix `replicates x outputs` with NaN where nothing was measured, and the JSON list
        /// of the replicates' names. `source` is `{"directory", "scenario", "layout"}`. Where the data state their noise,
        /// the JSON is `{"replicates": ["…"], "sd": true, "covariance": true}` in the place of the list: with `sd` a
        /// matrix of standard deviations follows (`replicates x outputs`, a row of NaN for a replicate that states none,
        /// zero where nothing was measured), with `covariance` that of one complete measurement (`outputs x outputs`).
        may measurements(plugin: *mut c_void, source: Text, answer: *const Answer) -> i32;
        /// Answers the numbers of an axis at which a scenario was measured: one row. `source` is
        /// `{"directory", "scenario", "axis", "unit"}`.
        may grid(plugin: *mut c_void, source: Text, answer: *const Answer) -> i32;
        /// One response from one file.
        may response(plugin: *mut c_void, path: Text, layout: Text, outputs: usize, values: *mut f64, answer: *const Answer) -> i32;
        /// How many of so many simulation runs may fail; `ABSENT` where the options do not say it. Since version 1.1.
        may allowed_failures(plugin: *mut c_void, runs: usize, allowed: *mut usize, answer: *const Answer) -> i32;
    }
}
