//! Effects.

use super::{Numbers, Text};

functions! {
    /// One candidate piece of missing physics on the model's response. Its first parameter is its size. `layout` is the
    /// shape of a response as JSON.
    EffectFunctions of plugin, served by ServeEffect {
        /// Answers what it is, as JSON: `{"title", "formula", "source", "reach"}`; the reach is `any`, `single` or `whole`.
        must describe();
        /// Answers its unknowns, a JSON list as that of a likelihood's hyperparameters.
        must parameters(layout: Text);
        /// Answers the values at which it is absent: one row.
        must absent(layout: Text);
        /// The responses with the effect, one a row, for the values of each row.
        must apply(layout: Text, responses: Numbers, values: Numbers, changed: *mut f64);
        /// Answers values from which a fit finds every mode, one a row. `situation` is
        /// `{"layouts", "response", "noise"}`.
        must starts(layout: Text, situation: Text);
        /// The derivatives of each output (rows) by each parameter (columns), for one response and its values.
        may by_parameters(layout: Text, response: Numbers, values: Numbers, jacobian: *mut f64);
        /// The derivatives of one response along each row of `tangents`.
        may push_forward(layout: Text, response: Numbers, values: Numbers, tangents: Numbers, changed: *mut f64);
        /// Answers the versions of itself that a search for missing effects should try, a JSON list of options.
        may proposals(situation: Text);
    }
}
