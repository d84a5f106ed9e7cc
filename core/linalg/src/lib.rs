//! Dense linear algebra in `f64`.
//!
//! The only crate of Lacuna that calls `faer`. It is small and not generic, so that the development profile can compile
//! it optimised: generic code is compiled where it is used, and unoptimised factorisations are hundreds of times
//! slower. Every routine runs on one thread, because results must not depend on the number of threads; parallelism
//! belongs to chains, outputs and runs.
//!
//! Shapes are a precondition: a routine panics if they do not fit, as slices do. Values are not: a matrix that is not
//! finite or not positive definite gives an [`Error`].

mod cholesky;
mod eigen;
mod error;
mod faer_view;
pub mod lanes;
pub mod level;
mod packed;
mod product;
mod qr;
pub mod radial;
mod svd;
mod triangular;
pub mod wide;

pub use cholesky::Cholesky;
pub use eigen::{SymmetricEigen, symmetric_eigen};
pub use error::Error;
pub use lacuna_base::matrix::{Matrix, multiply_vector, transposed_multiply_vector, vector};
pub use packed::PackedUpper;
pub use product::{
    gram, gram_lower, multiply, multiply_lower, multiply_transposed, transposed_multiply,
};
pub use qr::{LeastSquares, Qr, least_squares, thin_qr, triangular_factor};
pub use svd::{Svd, thin_svd};
pub use triangular::{
    solve_lower, solve_lower_matrix, solve_lower_transposed, solve_upper, solve_upper_matrix,
    solve_upper_transposed,
};
