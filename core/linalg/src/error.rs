//! Errors of factorisations.

use std::fmt;

use crate::Matrix;

/// Reason why a factorisation has no result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Error {
    /// An entry of the input is NaN or infinite.
    NotFinite {
        /// Row of the first such entry.
        row: usize,
        /// Column of that entry.
        column: usize,
    },
    /// A Cholesky factorisation encountered a pivot that is not positive.
    NotPositiveDefinite {
        /// Row of that pivot.
        pivot: usize,
    },
    /// An iterative factorisation did not converge.
    NotConverged,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite { row, column } => {
                write!(f, "the matrix has no finite number at row {row}, column {column}")
            }
            Self::NotPositiveDefinite { pivot } => {
                write!(f, "the matrix is not positive definite (pivot {pivot})")
            }
            Self::NotConverged => f.write_str("the factorisation did not converge"),
        }
    }
}

impl std::error::Error for Error {}

/// Fails at the first entry that is NaN or infinite.
pub(crate) fn finite(a: &Matrix) -> Result<(), Error> {
    // Without an end inside a piece, several entries are compared at once.
    const PIECE: usize = 64;
    let is_finite = |piece: &[f64]| piece.iter().fold(true, |all, x| all & x.is_finite());
    if a.as_slice().chunks(PIECE).all(is_finite) {
        return Ok(());
    }
    match a.as_slice().iter().position(|x| !x.is_finite()) {
        Some(flat) => Err(Error::NotFinite { row: flat / a.columns(), column: flat % a.columns() }),
        None => Ok(()),
    }
}
