//! What the misfit of which a noise is estimated is taken from.

use crate::gap::fit::precision;
use crate::gap::system::{Linearised, System};
use crate::linalg::Matrix;

/// A response with what the unknowns that were calibrated can do to it.
#[derive(Debug, Clone)]
pub struct Around {
    /// The response.
    pub response: Vec<f64>,
    /// How it moves with each unknown, in units of the prior's width; one unknown a row.
    pub slopes: Matrix,
}

impl Around {
    /// A response that no unknown was fitted to.
    pub fn fixed(response: &[f64]) -> Self {
        Self { response: response.to_vec(), slopes: Matrix::zeros(0, response.len()) }
    }

    /// The response of a system at its best fit.
    pub fn fit(system: &System<'_>, at: &Linearised) -> Self {
        let widths: Vec<f64> = system.priors().iter().map(|p| 1.0 / precision(p).sqrt()).collect();
        let slopes = Matrix::from_fn(at.tangents.rows(), at.tangents.columns(), |j, i| {
            widths[j] * at.tangents[(j, i)]
        });
        Self { response: at.response.clone(), slopes }
    }
}
