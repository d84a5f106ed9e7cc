//! Surrogates and their emulators.

use std::ffi::c_void;

use super::{Key, Linear, Numbers, Text};

functions! {
    /// The progress of a fit.
    ProgressFunctions of progress, served by ServeProgress {
        /// So many more units of work (outputs) are done. Any thread may call it.
        must add(units: u64) -> ();
        /// Something a person should know.
        must warn(text: Text) -> ();
    }
}

record! {
    /// Tells a person how far a fit came.
    Progress {
        /// The size of this struct in bytes.
        size: usize,
        /// The first argument of the functions.
        progress: *mut c_void,
        /// The functions.
        functions: *const ProgressFunctions,
    }
}

record! {
    /// The runs to which a surrogate is fitted.
    Training {
        /// The size of this struct in bytes.
        size: usize,
        /// Parameters and shapes of the responses, as JSON: `{"parameters", "layouts"}`.
        about: Text,
        /// The parameters of each run in physical units, `runs x parameters`.
        points: Numbers,
        /// The responses, `runs x outputs`.
        responses: Numbers,
    }
}

functions! {
    /// A fitted surrogate. Points are in physical units, one a row.
    EmulatorFunctions of emulator ended by destroy, served by ServeEmulator {
        /// The means, `points x outputs`.
        must mean(points: Numbers, values: *mut f64);
        /// The derivative of each output (rows) by each parameter (columns) at one point.
        must jacobian(point: Numbers, jacobian: *mut f64);
        /// Answers the leave-one-out error of each output relative to its variance, one row, and the leave-one-out
        /// residuals, `runs x outputs`.
        must fit_error();
        /// Answers the emulator as bytes, for `load`.
        must save();
        /// The emulator's own variance, `points x outputs`; `ABSENT` where it knows none.
        may variance(points: Numbers, values: *mut f64);
        /// The emulator as a linear combination of basis functions, which lives as long as the emulator; `ABSENT` where
        /// it is none.
        may linear(out: *mut Linear);
        /// Answers moments and Sobol' indices as JSON; `ABSENT` where the method does not know them exactly.
        may sensitivity();
        /// Answers what is worth telling, a JSON list of `{"name", "value"}`.
        may facts();
        /// The means at one point, and the derivatives of each output (rows) by `count` parameters (columns), given by their
        /// numbers from zero; by all, in order, where `parameters` is null. What `mean` and `jacobian` answer, where that
        /// costs less together. Since version 1.1.
        may mean_and_jacobian(point: Numbers, parameters: *const usize, count: usize, mean: *mut f64, jacobian: *mut f64);
    }
}

record! {
    /// A fitted surrogate.
    Emulator {
        /// The size of this struct in bytes.
        size: usize,
        /// The first argument of the functions.
        emulator: *mut c_void,
        /// The functions.
        functions: *const EmulatorFunctions,
        /// The number of parameters.
        dimension: usize,
        /// The number of outputs.
        outputs: usize,
    }
}

record! {
    /// A part of a sum of emulators.
    Summand {
        /// The bytes that `save` of an emulator answered.
        bytes: Text,
        /// One weight an output.
        weights: Numbers,
    }
}

functions! {
    /// Fits emulators to simulation runs.
    SurrogateFunctions of plugin, served by ServeSurrogate {
        /// Fits an emulator to all outputs.
        must fit(training: *const Training, key: Key, progress: *const Progress, out: *mut Emulator);
        /// An emulator from what `save` answered.
        must load(bytes: Text, out: *mut Emulator);
        /// The sum of `count` emulators that this surrogate fitted, each output of each times its weight, plus an offset for
        /// each output (one row), as one emulator of the same form: it is asked for the response and its sensitivity
        /// only. `ABSENT` where the method has no such form, or these emulators do not go together. Since version 1.1.
        may sum(parts: *const Summand, count: usize, offset: Numbers, out: *mut Emulator);
    }
}
