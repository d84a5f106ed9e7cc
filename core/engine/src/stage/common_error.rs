//! Errors that are common to all replicates.

use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin};
use lacuna_linalg::Matrix;

/// An error of emulator or numerics, in two sizes.
#[derive(Debug, Clone)]
pub struct Allowance {
    /// For estimates: enlarged until held-out errors shift the estimates by as much as the posterior states.
    pub estimates: CommonError,
    /// For predictions of data: the size of the held-out errors themselves.
    pub predictions: CommonError,
}

impl Allowance {
    /// Both sizes of an error that is common to all data; the factors are `outputs x rank`.
    pub fn new(origin: ErrorOrigin, [estimates, predictions]: [Matrix; 2]) -> Self {
        let error = |factor: Matrix| CommonError {
            origin: origin.clone(),
            factor: factor.into(),
            predictive: true,
        };
        Self { estimates: error(estimates), predictions: error(predictions) }
    }
}
