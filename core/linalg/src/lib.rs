//! Dense linear algebra in `f64`.
//!
//! The only crate of Lacuna that calls `faer`. It is small and not generic, so that the development
//! profile can compile it optimised: generic code is compiled where it is used, and unoptimised
//! factorisations are hundreds of times slower. Every routine runs on one thread, because
//! results must not depend on the number of threads; parallelism belongs to chains, outputs and runs.

mod matrix;

pub use matrix::Matrix;
