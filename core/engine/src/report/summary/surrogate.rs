//! The keys of the surrogate.

use schemars::JsonSchema;
use serde::Serialize;

use super::value::{ByName, Quantity};
use crate::report::findings::{Findings, SurrogateFindings};

/// Surrogate and its errors.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Surrogate {
    /// Mean absolute error over validation runs and outputs, in `surrogate.unit`.
    pub mae: Quantity,
    /// Root mean square error over validation runs and outputs, in `surrogate.unit`.
    pub rmse: Quantity,
    /// Leave-one-out error divided by the variance of the output, mean over outputs.
    pub loo: f64,
    /// Unit of the response.
    pub unit: String,
    /// Number of training runs.
    pub training: usize,
    /// Number of validation runs.
    pub validation: usize,
    /// Root mean square difference between emulator and model at posterior draws at which the model was run
    /// (`validate.emulator_check`), in `surrogate.unit`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near_posterior: Option<Quantity>,
    /// Refinement near the posterior, if the study asks for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refine: Option<Refinement>,
    /// Sobol indices of each parameter over all outputs, if the surrogate provides them.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("propertyNames" = { "title": "parameter" }))]
    pub sobol: Option<ByName<Sobol>>,
}

/// Refinement of the surrogate near the posterior.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Refinement {
    /// Number of rounds.
    pub rounds: usize,
    /// Error of the emulator at the last new runs, before it was trained on them, divided by the standard deviation of
    /// the discrepancy, with `choose = "posterior_variance"` of that of the replicates' mean; both are root mean squares
    /// over outputs.
    pub ratio: Quantity,
    /// True if that ratio is as small as the study asks and the posterior is clear of the edges of the region in which
    /// the surrogate was trained.
    pub reached: bool,
}

/// Sobol indices of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Sobol {
    /// First-order index, from 0 to 1.
    pub first: Quantity,
    /// Total index, from 0 to 1.
    pub total: Quantity,
}

impl Surrogate {
    pub fn of(findings: &Findings, found: &SurrogateFindings) -> Self {
        let refine =
            |(rounds, ratio, _, reached)| Refinement { rounds, ratio: Quantity(ratio), reached };
        let sobol = |indices: &Vec<(f64, f64)>| -> ByName<Sobol> {
            let named = findings.parameters.iter().zip(indices);
            named
                .map(|(p, &(first, total))| {
                    (p.name.clone(), Sobol { first: first.into(), total: total.into() })
                })
                .collect()
        };
        Self {
            mae: found.mae.into(),
            rmse: found.rmse.into(),
            loo: found.loo,
            unit: findings.layouts.unit().to_string(),
            training: found.training,
            validation: found.validation,
            near_posterior: found.near_posterior.map(|(error, _)| error.into()),
            refine: found.refinement.map(refine),
            sobol: found.sobol.as_ref().map(sobol),
        }
    }
}
