//! Readers.

use super::Text;

functions! {
    /// Reads files of one family of formats. Errors that are `REJECTED` may be the JSON object
    /// `{"path", "place", "message", "help"}`.
    ReaderFunctions of plugin, served by ServeReader {
        /// 1 where it understands a file, judged by its first bytes (at most 4096) and its name.
        must recognises(path: Text, head: Text) -> i32;
        /// Answers what is in a file, as JSON:
        /// `{"format", "facts": [["…", "…"]], "variables": [{"name", "on", "axes", "unit", "range", "not_finite", "columns": [{"name", "unit"}]}]}`,
        /// and for each variable a matrix with its columns.
        must inspect(path: Text);
        /// 1 where the options name files of the user's own.
        must names_files() -> i32;
        /// Answers the files that the options name, a JSON list of paths; `source` is `{"directory", "scenario"}`.
        must files(source: Text);
        /// Answers simulation runs: a matrix of parameters and one of responses, one run a row, and the JSON object
        /// `{"runs": ["…"], "valid": [true], "failed": [{"run", "reason"}]}`. `source` is `{"directory", "simulated", "parameters", "scenario", "layout"}`.
        may ensemble(source: Text);
        /// Answers measurements: a matrix `replicates x outputs` with NaN where nothing was measured, and the JSON list
        /// of the replicates' names. `source` is `{"directory", "scenario", "layout"}`. Where the data state their noise,
        /// the JSON is `{"replicates": ["…"], "sd": true, "covariance": true}` in the place of the list: with `sd` a
        /// matrix of standard deviations follows (`replicates x outputs`, a row of NaN for a replicate that states none,
        /// zero where nothing was measured), with `covariance` that of one complete measurement (`outputs x outputs`).
        may measurements(source: Text);
        /// Answers the numbers of an axis at which a scenario was measured: one row. `source` is
        /// `{"directory", "scenario", "axis", "unit"}`.
        may grid(source: Text);
        /// One response from one file.
        may response(path: Text, layout: Text, outputs: usize, values: *mut f64);
        /// Writes the number of failures that so many simulation runs may have; `ABSENT` where the options do not say it. Since version 1.1.
        may allowed_failures(runs: usize, allowed: *mut usize);
    }
}
