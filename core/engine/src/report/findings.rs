//! The content of the report, as plain data gathered from the artifacts of the stages.

use lacuna::data::{FailedRun, Layouts, Observations, Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::Fact;
use lacuna::plugin::sampler::Evidence;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::assess::Assessment;
use crate::screening::{ActiveSubspace, Screening};

pub use crate::gap::result::GapFindings;
use crate::stage::calibrate::PopulationOutcome;
pub use crate::stage::drawn::DrawnResponses;
pub use crate::stage::energies::Energies;
pub use crate::stage::fields::{FieldBand, FieldFindings};
pub use crate::stage::main_effects::MainEffect;
pub use crate::stage::mixing::Mixing;
pub use crate::stage::quantities::{
    Bounds, BoundsFindings, End, InputShare, PROBABILITIES, Propagated, QuantityFindings, Range,
};
pub use crate::stage::reliability::RareEvent;
use crate::stage::screen::FlaggedCurve;
use crate::stage::validate::ValidationFindings;

/// Results of one run of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Findings {
    /// Title of the study.
    pub title: String,
    /// Name of the study (the stem of its file).
    pub study: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Version of Lacuna.
    pub version: String,
    /// Components of the study: kind and plugin, such as `sampler` and `affine_invariant_ensemble`.
    pub components: Vec<(String, String)>,
    /// Parameters of the model.
    pub parameters: Vec<Parameter>,
    /// Places of the parameters of which intervals are known and no priors.
    pub intervals: Vec<usize>,
    /// Facts about the dependence of the priors; empty if they are independent.
    pub prior: Vec<Fact>,
    /// Random fields.
    pub fields: Vec<FieldFindings>,
    /// Shapes of the responses, scenario by scenario.
    pub layouts: Layouts,
    /// Simulation runs.
    pub ensemble: Option<EnsembleFindings>,
    /// Measured data.
    pub measured: Option<MeasuredFindings>,
    /// Surrogate.
    pub surrogate: Option<SurrogateFindings>,
    /// Calibration.
    pub calibration: Option<CalibrationFindings>,
    /// Draws of the posterior with their responses.
    pub drawn: Option<DrawnResponses>,
    /// Validation.
    pub validation: Option<ValidationFindings>,
    /// Predicted quantities of interest.
    pub quantities: Vec<QuantityFindings>,
    /// Propagated priors of a study without data.
    pub propagated: Option<Propagated>,
    /// Probabilities of rare events.
    pub reliability: Vec<RareEvent>,
    /// Result of the gap search.
    pub gap: Option<GapFindings>,
    /// Version of Lacuna that computed the result of each stage.
    pub made_by: Vec<(String, String)>,
    /// Time in which the result of each stage was computed, in seconds.
    pub seconds: Vec<(String, f64)>,
    /// Assessment of whether the results can be trusted.
    pub assessment: Assessment,
    /// Warnings of the run that are no findings of the assessment, such as failed runs or evaluations without an
    /// answer.
    pub warnings: Vec<String>,
    /// Limits of the model and the data, such as that they are a stand-in: the `note` of the study.
    pub note: Option<String>,
}

/// Simulation runs.
#[derive(Debug, Clone, PartialEq)]
pub struct EnsembleFindings {
    /// Parameters of the runs in physical units, `runs x parameters`.
    pub points: Matrix,
    /// Inputs that the runs vary.
    pub inputs: Vec<RunInput>,
    /// One entry per run, true if it is inside the model's range of validity.
    pub valid: Vec<bool>,
    /// Runs without a response.
    pub failed: Vec<FailedRun>,
    /// Number of runs inside the prior's support.
    pub in_prior: usize,
    /// Effects of the inputs as far as the runs show them, one entry per input.
    pub screening: Option<Screening>,
    /// Directions of the inputs in which the response changes, if the derivatives at the runs are known.
    pub active: Option<ActiveSubspace>,
}

/// An input that the runs vary: a parameter, or one of which each group has its own value in the calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct RunInput {
    /// Name, without a group.
    pub name: String,
    /// Symbol, without a group.
    pub symbol: String,
    /// Places among the parameters.
    pub places: Vec<usize>,
}

/// Measured data.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredFindings {
    /// Replicates that the calibration used, without added curves.
    pub used: Observations,
    /// Curves that the screen for outliers flagged.
    pub flagged: Vec<FlaggedCurve>,
    /// Number of data in the likelihood, added curves included.
    pub data_count: usize,
    /// Hash of those data; it is equal for two runs with the same data.
    pub fingerprint: String,
    /// Curves per sensor that were added to the replicates (`mean`, `q025`, `q975`).
    pub added_curves: Vec<String>,
}

/// Surrogate and its errors.
#[derive(Debug, Clone, PartialEq)]
pub struct SurrogateFindings {
    /// Number of rounds of refinement, ratio of the emulator's error near the posterior to the discrepancy, what it is
    /// compared with in words, and true if the target was reached; `None` without refinement.
    pub refinement: Option<(usize, f64, &'static str, bool)>,
    /// Facts that the method states of itself.
    pub facts: Vec<Fact>,
    /// Number of training runs.
    pub training: usize,
    /// Number of validation runs.
    pub validation: usize,
    /// Mean absolute error over the validation runs and outputs, in the unit of the response.
    pub mae: f64,
    /// Root mean square error over the validation runs and outputs, in the unit of the response.
    pub rmse: f64,
    /// Leave-one-out error relative to the variance of the output, mean over outputs.
    pub loo: f64,
    /// Errors of each group: name, mean absolute error, root mean square error, leave-one-out error.
    pub by_group: Vec<(String, f64, f64, f64)>,
    /// Root mean square error at posterior draws at which the model was run, with the number of those runs.
    pub near_posterior: Option<(f64, usize)>,
    /// Validation pairs (simulated, emulated) for a scatter plot, thinned to a few thousand.
    pub pairs: Vec<(f64, f64)>,
    /// Leave-one-out error of each output relative to its variance.
    pub loo_by_output: Vec<f64>,
    /// Total Sobol indices of each output, `outputs x parameters`, if known.
    pub total_by_output: Option<Matrix>,
    /// First-order and total Sobol indices over all outputs, one pair per parameter, if known.
    pub sobol: Option<Vec<(f64, f64)>>,
    /// Main effects of the parameters of the runs, the largest first.
    pub main_effects: Vec<MainEffect>,
}

/// Posterior of all unknowns.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationFindings {
    /// Coordinates: parameters first, then hyperparameters, then derived quantities.
    pub coordinates: Vec<CoordinateFindings>,
    /// All draws, burn-in included: `[chain][step][coordinate]` flattened in that order, in natural units.
    pub draws: Vec<f64>,
    /// Number of chains.
    pub chains: usize,
    /// Number of steps of each chain.
    pub steps: usize,
    /// Number of first steps of each chain that are discarded.
    pub burn_in: usize,
    /// Posterior correlation of the coordinates.
    pub correlation: Matrix,
    /// Share of accepted moves of each chain.
    pub acceptance: Vec<f64>,
    /// Indices of chains that stayed far below the bulk of the density.
    pub stranded: Vec<usize>,
    /// True if the chains converged.
    pub converged: bool,
    /// Reason why they converged or did not, and the number of further steps needed.
    pub verdict: String,
    /// Unnormalised log posterior density at the optimised MAP and at the best draw.
    pub log_density: (f64, f64),
    /// Best draw, in natural units.
    pub best_draw: Vec<f64>,
    /// How the chains of the first coordinates mix.
    pub mixing: Vec<Mixing>,
    /// Energies of a Hamiltonian sampler.
    pub energies: Option<Energies>,
    /// Facts about the sampler.
    pub facts: Vec<Fact>,
    /// Populations from which parameters by group are drawn.
    pub populations: Vec<PopulationOutcome>,
    /// Evidence of the study.
    pub evidence: Option<Evidence>,
    /// Prediction of each datum from all others.
    pub left_out: Option<LeftOutFindings>,
}

/// Prediction of each datum from all others (PSIS-LOO).
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOutFindings {
    /// Expected log predictive density (`elpd_loo`), summed over the data.
    pub elpd: f64,
    /// Standard error of `elpd` if the data were independent.
    pub error: f64,
    /// Standard error of `elpd` from the scatter over the curves; `None` below two curves.
    pub error_by_curve: Option<f64>,
    /// Effective number of parameters (`p_loo`).
    pub parameters: f64,
    /// Number of data whose estimates cannot be trusted.
    pub unreliable: usize,
    /// Largest k-hat at which an estimate can be trusted with this number of draws.
    pub limit: f64,
    /// Number of data.
    pub count: usize,
    /// Shape k-hat of the importance ratios of each datum, in the order of the likelihood.
    pub k_hat: Vec<f64>,
    /// Probability of a value below the measured one under the prediction of each datum (LOO-PIT), in the order of the
    /// likelihood; empty if it is not known.
    pub below: Vec<f64>,
    /// Prediction of whole curves, each from all others.
    pub curves: Option<CurvesLeftOutFindings>,
}

/// Prediction of each curve from all others (PSIS with the joint density of a curve).
#[derive(Debug, Clone, PartialEq)]
pub struct CurvesLeftOutFindings {
    /// Expected log predictive density (`elpd_loo`), summed over the curves.
    pub elpd: f64,
    /// Standard error of `elpd` from the scatter over the curves.
    pub error: f64,
    /// Effective number of parameters (`p_loo`).
    pub parameters: f64,
    /// Number of curves whose estimates cannot be trusted.
    pub unreliable: usize,
    /// Number of curves.
    pub count: usize,
}

/// Kind of an unknown of the posterior.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// A parameter of the model, or location or scale of a population of such parameters.
    Parameter,
    /// An unknown of a discrepancy or effect.
    Hyperparameter,
    /// A quantity that follows from the parameters.
    Derived,
}

/// One coordinate of the posterior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CoordinateFindings {
    /// Name of the coordinate.
    pub name: String,
    /// Symbol in figures.
    pub symbol: String,
    /// Unit of the coordinate.
    pub unit: Unit,
    /// Role of the coordinate in the posterior.
    pub role: Role,
    /// Prior of the coordinate; `None` if it has none of its own.
    pub prior: Option<Distribution>,
    /// Reference value, if the study gives one.
    pub reference: Option<f64>,
    /// Posterior mean.
    pub mean: f64,
    /// Posterior standard deviation.
    pub sd: f64,
    /// 2.5 % quantile.
    pub q025: f64,
    /// Posterior median.
    pub median: f64,
    /// 97.5 % quantile.
    pub q975: f64,
    /// Value at the maximum of the joint posterior density.
    pub map: f64,
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
    /// Named distributions fitted to the marginal, best first.
    pub fits: Vec<FittedDistribution>,
}

/// Named distribution fitted to a marginal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FittedDistribution {
    /// Fitted distribution.
    pub distribution: Distribution,
    /// Kolmogorov-Smirnov distance.
    pub ks: f64,
    /// p-value of that distance at the effective sample size.
    pub p_value: f64,
    /// Akaike information criterion relative to the best of the list.
    pub delta_aic: f64,
}
