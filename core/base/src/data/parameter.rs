//! Unknown parameters of a model.

use serde::{Deserialize, Serialize};

use super::Unit;
use crate::math::distribution::Distribution;

/// An unknown parameter of the model, as the study declares it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Name, equal to that of an input of the model.
    pub name: String,
    /// Symbol used in figures, such as `x1`; the name if the study gives none.
    pub symbol: String,
    /// Unit of the parameter; design, prior and reference are in this unit.
    pub unit: Unit,
    /// Distribution of the design points: the region on which the surrogate is trained.
    pub design: Distribution,
    /// Prior of the calibration.
    pub prior: Distribution,
    /// Value from the literature or from practice, shown for comparison.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<f64>,
}

impl Parameter {
    /// A dimensionless parameter whose design distribution is its prior.
    pub fn plain(name: &str, prior: Distribution) -> Self {
        Self {
            name: name.to_owned(),
            symbol: name.to_owned(),
            unit: Unit::dimensionless(),
            design: prior.clone(),
            prior,
            reference: None,
        }
    }

    /// Standard deviation of the prior, or a quarter of its central 95 % range if the standard deviation does not exist.
    pub fn scale(&self) -> f64 {
        let sd = self.prior.variance().sqrt();
        if sd.is_finite() {
            sd
        } else {
            0.25 * (self.prior.quantile(0.975) - self.prior.quantile(0.025))
        }
    }
}
