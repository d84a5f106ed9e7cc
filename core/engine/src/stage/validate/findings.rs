//! Results of a validation.

use serde::{Deserialize, Serialize};

/// Comparison of the calibrated simulation with the data.
#[derive(Debug, Clone, PartialEq)]
pub struct ValidationFindings {
    /// Parameters that were compared with the data: the MAP, the reference parameters.
    pub cases: Vec<ValidationCase>,
    /// Number, mean and standard deviation of the replicates for each value of the layout, the last two in the
    /// response's unit.
    pub replicates: Vec<(usize, f64, f64)>,
    /// Difference between the replicates' mean and the response of the first case, in standard deviations of a new
    /// replicate (its 95 % band over twice 1.96), one value per output; NaN where nothing was measured.
    pub residuals: Vec<f64>,
    /// Posterior predictive 95 % band of a new replicate, lower and upper bound, one value per output.
    pub predictive: Option<(Vec<f64>, Vec<f64>)>,
    /// Standard deviation of a new replicate by origin, root mean square over outputs, in the response's unit.
    pub spread: Vec<(String, f64)>,
}

/// Comparison of one set of parameters with the data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ValidationCase {
    /// Name of the set of parameters: `map`, `reference`.
    pub name: String,
    /// Values of the parameters, in the study's order and units.
    pub point: Vec<f64>,
    /// Response at these parameters, one value per output: simulated if the model was run, else emulated. That at the MAP
    /// has the study's effects.
    pub response: Vec<f64>,
    /// True if the model itself was run.
    pub simulated: bool,
    /// Fraction of points inside the replicates' 95 % interval, for each group.
    pub accuracy: Vec<(String, f64)>,
    /// Mean of the groups' accuracies.
    pub average: f64,
    /// Root mean square difference from the replicates' mean, in the response's unit.
    pub rmse: f64,
}
