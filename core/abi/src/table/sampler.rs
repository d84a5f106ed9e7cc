//! Samplers, and the densities that they draw from.

use std::ffi::c_void;

use super::{Key, Numbers, Text};

functions! {
    /// A log density for samplers to ask.
    TargetFunctions of target, served by ServeTarget {
        /// The log density at each point; minus infinity outside the support, never NaN.
        must log_density(points: Numbers, values: *mut f64);
        /// The log prior density at each point.
        must log_prior(points: Numbers, values: *mut f64);
        /// The log density at one point and its gradient.
        must gradient(point: Numbers, value: *mut f64, gradient: *mut f64);
        /// The closed interval of each coordinate, infinite where it has no bound.
        must bounds(low: *mut f64, high: *mut f64);
        /// Independent draws from the prior, `count x dimension`.
        must prior_draws(count: usize, key: Key, points: *mut f64);
        /// Answers why the density can no longer be computed; `ABSENT` while it can.
        must failure();
    }
}

record! {
    /// A log density to draw from. It is there for the time of the call.
    Target {
        /// The size of this struct in bytes.
        size: usize,
        /// The first argument of the functions.
        target: *mut c_void,
        /// The functions.
        functions: *const TargetFunctions,
        /// The number of coordinates.
        dimension: usize,
    }
}

record! {
    /// The size of a run.
    Plan {
        /// The number of chains.
        chains: usize,
        /// The number of steps of each.
        steps: usize,
        /// The number of first steps in which the method adapts itself.
        warm_up: usize,
        /// 1 where the chains are walkers of one ensemble, and so not independent of each other.
        ensemble: u8,
    }
}

record! {
    /// The state of a sampler between two steps. The buffers are the caller's.
    State {
        /// The size of this struct in bytes.
        size: usize,
        /// The number of chains.
        chains: usize,
        /// The number of coordinates.
        dimension: usize,
        /// The point of each chain, `chains x dimension`.
        points: *mut f64,
        /// The log density there.
        log_density: *mut f64,
        /// 1 for each chain that moved in the last step.
        accepted: *mut u8,
        /// Evaluations of the log density so far.
        evaluations: u64,
        /// Whatever else the sampler keeps, as JSON. What a call writes as text of its answer takes its place.
        memory: Text,
    }
}

functions! {
    /// Draws from a log density step by step. All that a sampler remembers is in the state, so that a run that was
    /// killed goes on with the same bits.
    SamplerFunctions of plugin, served by ServeSampler {
        /// Writes the numbers of chains and steps that a run has on a density of this dimension.
        must plan(dimension: usize, plan: *mut Plan);
        /// The state before the first step: its points are the starting points already.
        must start(target: *const Target, state: *mut State);
        /// One step of all chains; the key belongs to this step alone.
        must step(target: *const Target, state: *mut State, key: Key);
        /// 1 where this state is the last one, however many steps the plan has.
        may finished(state: *const State) -> i32;
        /// Answers the draws of a method whose steps are no draws themselves: a matrix of points, a row of log
        /// densities, and the JSON object `{"effective_size", "evidence", "doubts", "facts"}`. `ABSENT` where
        /// the points of each step are draws.
        may harvest(target: *const Target, state: *const State, key: Key);
        /// Answers reasons not to trust the draws of a run that ended in this state, a JSON list of texts.
        may doubts(state: *const State);
        /// Answers what a person should know of such a run, a JSON list of texts.
        may notes(state: *const State);
        /// Answers what is worth telling of the method, a JSON list of `{"name", "value"}`.
        may facts();
        /// Writes 1 where the chains begin at the starting points that they are given, as they do where it is null; 0 for
        /// a method that draws its own from the prior. Since version 1.1.
        may uses_starts(uses: *mut u8);
        /// Answers where the chains start when the study does not say: `map` (about the maximum of the posterior density,
        /// as where it is null), `prior` or `sobol`. Since version 1.1.
        may start_where();
        /// Writes 1 where the points of each step are draws, so that a run may end after any number of steps past the
        /// warm-up; 0, or null, where they are not. Since version 1.1.
        may steps_are_draws(draws: *mut u8);
        /// Answers what there is to tell of the last step of each chain beside its point: a JSON list of `{"name", "kind"}`
        /// with the kind `flag` (0 or 1), `count` or `number`, and a matrix `statistics x chains`, NaN before the first
        /// step. The same statistics in the same order of every state; `ABSENT` where there are none. Since version
        /// 1.1.
        may statistics(state: *const State);
    }
}
