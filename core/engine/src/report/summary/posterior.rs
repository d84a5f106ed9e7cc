//! The keys of the calibration: posterior, chains, evidence, prediction of held-out data.

use schemars::JsonSchema;
use serde::Serialize;

use super::fields::{self, Field};
use super::populations::{self, Population};
use super::value::{ByName, Quantity};
use crate::report::findings::{
    CalibrationFindings, CoordinateFindings, CurvesLeftOutFindings, Findings, LeftOutFindings, Role,
};
use crate::report::qualified;

/// The keys that a calibration adds to the summary.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Calibration {
    /// Posterior of each unknown, from the draws after the burn-in: parameters, then hyperparameters, then derived
    /// quantities.
    #[schemars(extend("propertyNames" = { "title": "name" }))]
    pub parameters: ByName<Marginal>,
    /// Populations from which parameters by group are drawn.
    #[serde(skip_serializing_if = "ByName::is_empty")]
    #[schemars(extend("propertyNames" = { "title": "name" }))]
    pub populations: ByName<Population>,
    /// Random fields (`[[field]]`).
    #[serde(skip_serializing_if = "ByName::is_empty")]
    #[schemars(extend("propertyNames" = { "title": "name" }))]
    pub fields: ByName<Field>,
    /// Posterior correlation of the unknowns.
    pub correlation: Correlation,
    /// Acceptance rate over the chains, if the sampler has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acceptance: Option<Acceptance>,
    /// Chains of the sampler.
    pub chains: Chains,
    /// True if the chains converged according to the diagnostics of the draws.
    pub converged: bool,
    /// Reason in words why the run converged or did not converge.
    pub verdict: String,
    /// Logarithm of the unnormalised posterior density.
    pub log_density: LogDensity,
    /// Evidence: the likelihood integrated over the prior.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evidence: Option<Evidence>,
    /// Prediction of each datum from all others by Pareto-smoothed importance sampling (PSIS-LOO).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loo: Option<LeaveOneOut>,
}

/// Posterior of one unknown, from the draws after the burn-in.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Marginal {
    /// Posterior mean.
    pub mean: Quantity,
    /// Posterior standard deviation.
    pub sd: f64,
    /// 2.5 % quantile.
    pub q025: f64,
    /// Posterior median.
    pub median: f64,
    /// 97.5 % quantile.
    pub q975: f64,
    /// Value at the maximum of the joint posterior density.
    pub map: Quantity,
    /// Rank-normalised split R-hat.
    pub r_hat: f64,
    /// Bulk effective sample size.
    pub ess_bulk: f64,
    /// Tail effective sample size.
    pub ess_tail: f64,
    /// Monte Carlo standard error of the mean.
    pub mcse_mean: f64,
    /// Integrated autocorrelation time, in steps.
    pub autocorrelation_time: f64,
    /// Unit of mean, standard deviations, quantiles, MAP and reference.
    pub unit: String,
    /// Kind of unknown.
    pub role: Role,
    /// Reference value, if the study gives one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<Quantity>,
}

/// Posterior correlation.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Correlation {
    /// Names of the unknowns, in the order of rows and columns.
    pub names: Vec<String>,
    /// Correlation coefficients, row by row.
    pub matrix: Vec<Vec<Quantity>>,
}

/// Acceptance rate over the chains.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Acceptance {
    /// Mean over the chains of the share of accepted moves.
    pub mean: Quantity,
    /// Smallest share of accepted moves of any chain.
    pub min: Quantity,
    /// Largest share of accepted moves of any chain.
    pub max: Quantity,
}

/// Chains of the sampler.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Chains {
    /// Number of chains.
    pub count: usize,
    /// Number of steps of each chain, burn-in included.
    pub steps: usize,
    /// Number of first steps of each chain that are discarded.
    pub burn_in: usize,
    /// Indices, from 0, of chains that stayed far below the bulk of the density.
    pub stranded: Vec<usize>,
}

/// Logarithm of the unnormalised posterior density.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LogDensity {
    /// Value at the maximum that the optimiser found (MAP).
    pub map: Quantity,
    /// Value at the best draw.
    pub best_draw: Quantity,
}

/// Evidence.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Evidence {
    /// Logarithm of the evidence.
    pub log: Quantity,
    /// Standard error of that logarithm.
    pub error: f64,
    /// Method of computation, in words.
    pub method: String,
    /// Reason why the evidence is that of a part of the posterior only, if a mode has no draws.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit: Option<String>,
}

/// Prediction of each datum from all others.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LeaveOneOut {
    /// Expected log predictive density (`elpd_loo`), summed over the data.
    pub elpd: Quantity,
    /// Standard error of `elpd` if the data were independent.
    pub error: f64,
    /// Standard error of `elpd` from the scatter over curves, whose values may depend on each other; `null` below two
    /// curves.
    pub error_by_curve: Option<f64>,
    /// Effective number of parameters (`p_loo`).
    pub parameters: Quantity,
    /// Number of data whose estimates cannot be trusted: k-hat above `loo.k_limit`.
    pub unreliable: usize,
    /// Largest k-hat at which an estimate can be trusted with this number of draws.
    pub k_limit: Quantity,
    /// Number of data.
    pub count: usize,
    /// Prediction of whole curves, each from all others; `null` if it was not computed.
    pub curves: Option<CurvesLeaveOneOut>,
}

/// Prediction of each curve from all others.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CurvesLeaveOneOut {
    /// Expected log predictive density (`elpd_loo`), summed over the curves.
    pub elpd: Quantity,
    /// Standard error of `elpd`, from the scatter over curves.
    pub error: f64,
    /// Effective number of parameters (`p_loo`).
    pub parameters: Quantity,
    /// Number of curves whose estimates cannot be trusted: k-hat above `loo.k_limit`.
    pub unreliable: usize,
    /// Number of curves.
    pub count: usize,
}

impl Calibration {
    pub fn of(findings: &Findings, found: &CalibrationFindings) -> Self {
        let named = found.coordinates.iter();
        let (map, best_draw) = found.log_density;
        Self {
            parameters: named.map(|c| (c.name.clone(), Marginal::of(c))).collect(),
            populations: populations::by_name(found),
            fields: fields::by_name(&findings.fields),
            correlation: Correlation::of(found),
            acceptance: Acceptance::of(&found.acceptance),
            chains: Chains {
                count: found.chains,
                steps: found.steps,
                burn_in: found.burn_in,
                stranded: found.stranded.clone(),
            },
            converged: found.converged,
            verdict: qualified::convergence(findings, found),
            log_density: LogDensity { map: map.into(), best_draw: best_draw.into() },
            evidence: found.evidence.as_ref().map(|e| Evidence {
                log: e.log.into(),
                error: e.error,
                method: e.method.clone(),
                limit: qualified::evidence(findings).map(str::to_owned),
            }),
            loo: found.left_out.as_ref().map(LeaveOneOut::of),
        }
    }
}

impl Marginal {
    fn of(c: &CoordinateFindings) -> Self {
        Self {
            mean: c.mean.into(),
            sd: c.sd,
            q025: c.q025,
            median: c.median,
            q975: c.q975,
            map: c.map.into(),
            r_hat: c.r_hat,
            ess_bulk: c.ess_bulk,
            ess_tail: c.ess_tail,
            mcse_mean: c.mcse_mean,
            autocorrelation_time: c.autocorrelation_time,
            unit: c.unit.to_string(),
            role: c.role,
            reference: c.reference.map(Quantity),
        }
    }
}

impl Correlation {
    fn of(found: &CalibrationFindings) -> Self {
        let row = |row: &[f64]| row.iter().copied().map(Quantity).collect();
        Self {
            names: found.coordinates.iter().map(|c| c.name.clone()).collect(),
            matrix: found.correlation.iter_rows().map(row).collect(),
        }
    }
}

impl Acceptance {
    /// Mean, smallest and largest share of accepted moves; `None` without chains.
    fn of(shares: &[f64]) -> Option<Self> {
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        let min = shares.iter().copied().fold(f64::NAN, f64::min);
        let max = shares.iter().copied().fold(f64::NAN, f64::max);
        (!shares.is_empty()).then(|| Self { mean: mean.into(), min: min.into(), max: max.into() })
    }
}

impl LeaveOneOut {
    fn of(loo: &LeftOutFindings) -> Self {
        Self {
            elpd: loo.elpd.into(),
            error: loo.error,
            error_by_curve: loo.error_by_curve,
            parameters: loo.parameters.into(),
            unreliable: loo.unreliable,
            k_limit: loo.limit.into(),
            count: loo.count,
            curves: loo.curves.as_ref().map(CurvesLeaveOneOut::of),
        }
    }
}

impl CurvesLeaveOneOut {
    fn of(curves: &CurvesLeftOutFindings) -> Self {
        Self {
            elpd: curves.elpd.into(),
            error: curves.error,
            parameters: curves.parameters.into(),
            unreliable: curves.unreliable,
            count: curves.count,
        }
    }
}
