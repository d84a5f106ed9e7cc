//! Kinds of plugins and the sections of a study that choose one.

use super::{
    Density, Design, Discrepancy, Effect, Executor, Model, Quantity, Reader, Reliability, Sampler,
    Surrogate, Term,
};

crate::kind!(Reader, "reader", ["simulations", "measurements"]);
crate::kind!(Design, "design", ["design"]);
crate::kind!(Model, "model", ["model"]);
crate::kind!(Executor, "executor", ["executor", "cases"]);
crate::kind!(Surrogate, "surrogate", ["surrogate"]);
crate::kind!(Discrepancy, "discrepancy", ["discrepancy"]);
crate::kind!(Sampler, "sampler", ["sampler"]);
crate::kind!(Effect, "effect", ["effect"]);
crate::kind!(Term, "term", ["gap.term"]);
crate::kind!(Quantity, "quantity", ["quantity"]);
crate::kind!(Reliability, "reliability", ["reliability"]);
crate::kind!(Density, "target", ["target"]);
