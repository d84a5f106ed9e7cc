//! The keys of random fields.

use schemars::JsonSchema;
use serde::Serialize;

use super::value::{ByName, Quantity};
use crate::report::findings::{FieldBand, FieldFindings};

/// Posterior of a random field (`[[field]]`) at its places, from at most 4000 draws. The neglected terms are added with their prior.
/// The posterior of the coefficients is under `parameters`.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Field {
    /// Unit of the values of the field.
    pub unit: String,
    /// Number of terms of its expansion.
    pub terms: usize,
    /// Share of the prior's variance, integrated over the places, that these terms keep; the model has no others.
    pub variance: Quantity,
    /// Places.
    pub at: Vec<Quantity>,
    /// Unit of the places.
    pub at_unit: String,
    /// Posterior mean at each place.
    pub mean: Vec<Quantity>,
    /// Posterior standard deviation at each place.
    pub sd: Vec<f64>,
    /// 2.5 % quantile at each place.
    pub q025: Vec<f64>,
    /// Posterior median at each place.
    pub median: Vec<f64>,
    /// 97.5 % quantile at each place.
    pub q975: Vec<f64>,
}

/// The fields of a calibration.
pub fn by_name(found: &[FieldFindings]) -> ByName<Field> {
    let one = |own: &FieldFindings| {
        Some((own.field.name.clone(), Field::of(own, own.posterior.as_ref()?)))
    };
    found.iter().filter_map(one).collect()
}

impl Field {
    fn of(found: &FieldFindings, posterior: &FieldBand) -> Self {
        let quantities = |values: &[f64]| values.iter().copied().map(Quantity).collect();
        let (field, FieldBand { mean, sd, q025, median, q975 }) = (&found.field, posterior.clone());
        Self {
            unit: field.unit.to_string(),
            terms: field.terms(),
            variance: Quantity(field.kept),
            at: quantities(&field.at),
            at_unit: field.at_unit.to_string(),
            mean: quantities(&mean),
            sd,
            q025,
            median,
            q975,
        }
    }
}
