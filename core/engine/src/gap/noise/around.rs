//! A response with its tangents: the mean around which noise is estimated.

use lacuna_linalg::Matrix;

/// A response with its derivatives by the unknowns that were calibrated.
#[derive(Debug, Clone)]
pub struct ResponseTangents {
    /// The response, one value an output, in its unit.
    pub response: Vec<f64>,
    /// The change of the response per prior width of each unknown, `unknowns x outputs`.
    pub slopes: Matrix,
}

impl ResponseTangents {
    /// A response to which no unknown was fitted.
    pub fn fixed(response: &[f64]) -> Self {
        Self { response: response.to_vec(), slopes: Matrix::zeros(0, response.len()) }
    }
}
