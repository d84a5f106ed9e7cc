//! Discrepancies and their likelihoods.

use std::ffi::c_void;

use super::{Key, Linear, Numbers, Text};

record! {
    /// An error that all replicates share, a covariance `F F'`.
    CommonErrorView {
        /// The origin: `emulator`, `numerics`, `replicates`.
        origin: Text,
        /// The factor `F`, `outputs x rank`, in the response's unit.
        factor: Numbers,
        /// 1 where a new replicate has it too, beside what the discrepancy adds to a replicate.
        predictive: u8,
    }
}

functions! {
    /// Functions of the data.
    KnownFunctions of known, served by ServeKnown {
        /// Answers the derivative of each output (rows) by each parameter (columns), in units of the prior's standard
        /// deviation of that parameter, where the model fits the data best: one matrix. It costs an optimisation.
        must slopes();
    }
}

record! {
    /// The data from which a likelihood is made. It is there for the time of the call.
    Known {
        /// The size of this struct in bytes.
        size: usize,
        /// The first argument of the functions.
        known: *mut c_void,
        /// The functions.
        functions: *const KnownFunctions,
        /// The shape of a complete measurement as JSON, and the names of the replicates:
        /// `{"layout": {…}, "replicates": ["…"]}`.
        about: Text,
        /// The measured values, `replicates x outputs`; zero where nothing was measured.
        values: Numbers,
        /// 1 where a value was measured, 0 where not, `replicates x outputs`.
        measured: *const u8,
        /// The errors that all replicates share: their covariances are added once to that of the mean curve, never
        /// divided by the number of replicates.
        common: *const CommonErrorView,
        /// The number of common errors.
        common_count: usize,
        /// The standard deviation of the noise of each value, where the data state it: `replicates x outputs`, a row of
        /// NaN for a replicate that states none, zero where nothing was measured; no rows where no replicate states
        /// any. Since version 1.1.
        sd: Numbers,
        /// The covariance of the noise of one complete measurement, `outputs x outputs`, where the data state it; no rows
        /// where they do not. Since version 1.1.
        covariance: Numbers,
    }
}

functions! {
    /// A likelihood as a function of the basis functions of a linear emulator.
    CompressedFunctions of compressed ended by destroy, served by ServeCompressed {
        /// The log-likelihood for each row of `basis` (`points x terms`) and of `hyper`.
        must log_likelihood(basis: Numbers, hyper: Numbers, values: *mut f64);
        /// The derivatives at each row by the basis functions and by the hyperparameters.
        must gradient(basis: Numbers, hyper: Numbers, by_basis: *mut f64, by_hyper: *mut f64);
        /// The values of `log_likelihood` at points in physical units, for those who can do with less than all basis
        /// functions.
        may log_likelihood_at(linear: *const Linear, points: Numbers, hyper: Numbers, values: *mut f64);
        /// The derivatives of `gradient`, by the parameters, at points in physical units.
        may gradient_at(linear: *const Linear, points: Numbers, hyper: Numbers, by_points: *mut f64, by_hyper: *mut f64);
    }
}

record! {
    /// A likelihood reduced to a small form in the basis functions of a linear emulator.
    Compressed {
        /// The size of this struct in bytes.
        size: usize,
        /// The first argument of the functions.
        compressed: *mut c_void,
        /// The functions.
        functions: *const CompressedFunctions,
    }
}

functions! {
    /// The likelihood of fixed measurements as a function of the response (one value an output) and of the
    /// hyperparameters, always for several points at once: one a row.
    LikelihoodFunctions of likelihood ended by destroy, served by ServeLikelihood {
        /// Answers the unknowns beside the model's parameters, a JSON list of
        /// `{"name", "symbol", "unit", "prior", "log", "start"}`.
        must hyperparameters();
        /// The log-likelihood for each row; minus infinity outside the support, never NaN.
        must log_likelihood(responses: Numbers, hyper: Numbers, values: *mut f64);
        /// The derivatives by the response and by the hyperparameters, one row a point.
        must gradient(responses: Numbers, hyper: Numbers, by_response: *mut f64, by_hyper: *mut f64);
        /// Answers the variance of a new replicate around the response, split by origin: the origins as a JSON list, and a
        /// matrix `origins x outputs`.
        must predictive(response: Numbers, hyper: Numbers);
        /// Data as this discrepancy would have made them, `replicates x outputs`; what stands where nothing was
        /// measured does not matter.
        must simulate(response: Numbers, hyper: Numbers, key: Key, values: *mut f64);
        /// Answers the log density of each measured value given all others, by replicate and output with gaps left
        /// out: one row. `ABSENT` where there is no such form.
        may left_out(response: Numbers, hyper: Numbers);
        /// The likelihood as a function of the basis functions of a linear emulator; `ABSENT` where there is no
        /// such form.
        may compress(linear: *const Linear, out: *mut Compressed);
        /// Answers what is worth telling, a JSON list of `{"name", "value"}`.
        may facts();
        /// Answers how it has the common errors, where it samples some of their directions and leaves the rest out: the variance of
        /// the mean curve without them, one row, infinite where nothing was measured; the factor of the errors that are sampled,
        /// `outputs x directions`; and of those that are left out, `outputs x any number`. `ABSENT` where it has
        /// their whole covariance. Since version 1.1.
        may sampled_errors(hyper: Numbers);
        /// Writes 1 where value and gradient take a number of operations proportional to the number of data, so that they can
        /// be computed many times for each response of the model; 0, or null, where not. Since version 1.2.
        may is_cheap(cheap: *mut u8);
    }
}

record! {
    /// The likelihood of fixed measurements.
    Likelihood {
        /// The size of this struct in bytes.
        size: usize,
        /// The first argument of the functions.
        likelihood: *mut c_void,
        /// The functions.
        functions: *const LikelihoodFunctions,
    }
}

functions! {
    /// A statistical model of the difference between model and data.
    DiscrepancyFunctions of plugin, served by ServeDiscrepancy {
        /// The likelihood of what is known.
        must likelihood(known: *const Known, out: *mut Likelihood);
        /// Answers the standard deviation of one replicate around a response, where the options say how large it is:
        /// one row, and a second one with the times over which correlations along the last axis fall by a
        /// factor e, where values are not independent. `ABSENT` where the noise is unknown.
        may stated_noise(layout: Text, response: Numbers);
        /// The likelihood of a part of the known data, some of whose values are missing, under the law that stands for
        /// all of them: what is estimated from the replicates is estimated from all. Of `part` only the data count.
        /// Hyperparameters keep their names; one that belongs to missing values alone may be gone. `ABSENT` where there
        /// is no such form. Since version 1.1.
        may likelihood_of_part(known: *const Known, part: *const Known, out: *mut Likelihood);
        /// Writes 1 where the likelihood uses the noise that the data state (`sd` and `covariance` of what is known), 0
        /// where not; where it does not, or is null, such data are refused. Since version 1.1.
        may takes_stated_noise(takes: *mut u8);
    }
}
