//! Everything the report shows, as plain data gathered from the stages' artifacts.

use serde::{Deserialize, Serialize};

use crate::assess::Assessment;
use crate::data::{FailedRun, Layouts, Observations, Parameter, Unit};
use crate::gap::account::{Account, HeldOut};
use crate::gap::added::Added;
use crate::linalg::Matrix;
use crate::math::distribution::Distribution;
use crate::plugin::Fact;
use crate::plugin::sampler::Evidence;

/// The results of one run of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Findings {
    /// The study's title.
    pub title: String,
    /// The study's name (the stem of its file).
    pub study: String,
    /// The seed.
    pub seed: u64,
    /// The version of Lacuna.
    pub version: String,
    /// What the study calls its components: kind and plugin, such as `sampler` and `affine_invariant_ensemble`.
    pub components: Vec<(String, String)>,
    /// The parameters of the model.
    pub parameters: Vec<Parameter>,
    /// The shapes of the responses to all scenarios.
    pub layouts: Layouts,
    /// The simulation runs.
    pub ensemble: Option<EnsembleFindings>,
    /// The measured data.
    pub measured: Option<MeasuredFindings>,
    /// The surrogate.
    pub surrogate: Option<SurrogateFindings>,
    /// The calibration.
    pub calibration: Option<CalibrationFindings>,
    /// The validation.
    pub validation: Option<ValidationFindings>,
    /// What the model misses.
    pub gap: Option<GapFindings>,
    /// The version of Lacuna that made the result of each stage.
    pub made_by: Vec<(String, String)>,
    /// The time each stage took when it was made, in seconds.
    pub seconds: Vec<(String, f64)>,
    /// Whether all this can be trusted, and what speaks against it.
    pub assessment: Assessment,
    /// What was told on the way beside these findings: runs left out, evaluations without an answer.
    pub warnings: Vec<String>,
    /// What the stand-in or the data are not, as the study's `note` says.
    pub note: Option<String>,
}

/// What the model misses.
#[derive(Debug, Clone, PartialEq)]
pub struct GapFindings {
    /// What the search found.
    pub account: Account,
    /// The hash of the files that hold it.
    pub hash: String,
    /// What the study with the effects found, where it was run.
    pub added: Option<Added>,
}

impl GapFindings {
    /// How the gap fares on what was set aside: by the study with the effects, where it was run, else by the search.
    pub fn held_out(&self) -> &[HeldOut] {
        match &self.added {
            Some(added) if !added.held_out.is_empty() => &added.held_out,
            _ => &self.account.held_out,
        }
    }
}

/// The simulation runs.
#[derive(Debug, Clone, PartialEq)]
pub struct EnsembleFindings {
    /// The runs' parameters in physical units, `runs x parameters`.
    pub points: Matrix,
    /// Whether each run stayed inside the model's range of validity.
    pub valid: Vec<bool>,
    /// Runs that were left out.
    pub failed: Vec<FailedRun>,
    /// How many runs lie inside the prior's support.
    pub in_prior: usize,
}

/// The measured data.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredFindings {
    /// The replicates that the calibration used, without added curves.
    pub used: Observations,
    /// Curves that the screen flagged.
    pub flagged: Vec<FlaggedCurve>,
    /// The number of data in the likelihood, added curves included.
    pub data_count: usize,
    /// A hash of those data: two runs with the same one saw the same data.
    pub fingerprint: String,
    /// Curves per sensor that were added to the replicates (`mean`, `q025`, `q975`).
    pub added_curves: Vec<String>,
}

/// A curve far from the other replicates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlaggedCurve {
    /// The replicate's name.
    pub replicate: String,
    /// The group (sensor).
    pub group: String,
    /// Its robust distance from the median curve, in robust standard deviations.
    pub distance: f64,
    /// The distance above which curves are flagged.
    pub threshold: f64,
    /// Whether the study left it out.
    pub left_out: bool,
}

/// How good the surrogate is.
#[derive(Debug, Clone, PartialEq)]
pub struct SurrogateFindings {
    /// Rounds of refinement, the emulator's error near the posterior over the discrepancy, and whether that is
    /// small enough; where the study asks for refinement.
    pub refinement: Option<(usize, f64, bool)>,
    /// What the method says of itself.
    pub facts: Vec<Fact>,
    /// Runs it was trained on, and runs kept for validation.
    pub training: usize,
    /// See `training`.
    pub validation: usize,
    /// Mean absolute error over the validation runs and outputs, in the response's unit.
    pub mae: f64,
    /// Root mean square error over the validation runs and outputs.
    pub rmse: f64,
    /// Leave-one-out error relative to the output's variance, mean over outputs.
    pub loo: f64,
    /// The same figures for each group: name, mean absolute error, root mean square error, leave-one-out.
    pub by_group: Vec<(String, f64, f64, f64)>,
    /// Root mean square error at posterior draws where the model was run anew, with their number.
    pub near_posterior: Option<(f64, usize)>,
    /// Validation pairs (simulated, emulated) for a scatter plot, thinned to a few thousand.
    pub pairs: Vec<(f64, f64)>,
    /// First-order and total Sobol indices over all outputs, one pair a parameter, where known.
    pub sobol: Option<Vec<(f64, f64)>>,
}

/// The posterior.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationFindings {
    /// The coordinates: parameters first, then hyperparameters, then derived quantities.
    pub coordinates: Vec<CoordinateFindings>,
    /// All draws, burn-in included: `[chain][step][coordinate]` flattened in that order, natural units.
    pub draws: Vec<f64>,
    /// The number of chains.
    pub chains: usize,
    /// The number of steps of each chain.
    pub steps: usize,
    /// The number of first steps that are left out of every summary.
    pub burn_in: usize,
    /// The posterior correlation of the coordinates.
    pub correlation: Matrix,
    /// The share of accepted moves of each chain.
    pub acceptance: Vec<f64>,
    /// Chains that stayed far below the bulk of the density.
    pub stranded: Vec<usize>,
    /// Whether the run converged.
    pub converged: bool,
    /// In words: why it did or did not, and how many more steps it needs.
    pub verdict: String,
    /// The log posterior density at the optimised MAP and at the best draw.
    pub log_density: (f64, f64),
    /// The best draw, natural units.
    pub best_draw: Vec<f64>,
    /// Facts about the sampler.
    pub facts: Vec<Fact>,
    /// The probability of the data.
    pub evidence: Option<Evidence>,
    /// How well each datum is predicted from all others.
    pub left_out: Option<LeftOutFindings>,
}

/// How well data are predicted from all others (PSIS-LOO).
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOutFindings {
    /// The expected log predictive density, summed over the data.
    pub elpd: f64,
    /// Its standard error, as if the data were independent of each other.
    pub error: f64,
    /// Its standard error from the scatter over the curves; `None` below two.
    pub error_by_curve: Option<f64>,
    /// The effective number of parameters.
    pub parameters: f64,
    /// How many data have estimates that cannot be trusted.
    pub unreliable: usize,
    /// The largest k-hat that can be trusted with the draws there are.
    pub limit: f64,
    /// The number of data.
    pub count: usize,
    /// The prediction of whole curves from all others.
    pub curves: Option<CurvesLeftOutFindings>,
}

/// How well whole curves are predicted from all others (PSIS with the joint density of a curve).
#[derive(Debug, Clone, PartialEq)]
pub struct CurvesLeftOutFindings {
    /// The expected log predictive density, summed over the curves.
    pub elpd: f64,
    /// Its standard error, from the scatter over the curves.
    pub error: f64,
    /// The effective number of parameters.
    pub parameters: f64,
    /// How many curves have estimates that cannot be trusted.
    pub unreliable: usize,
    /// The number of curves.
    pub count: usize,
}

/// What a coordinate is of the posterior.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// A parameter of the model.
    Parameter,
    /// An unknown of a discrepancy or effect.
    Hyperparameter,
    /// A quantity that follows from the parameters.
    Derived,
}

/// One coordinate of the posterior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CoordinateFindings {
    /// Its name.
    pub name: String,
    /// Its symbol in figures.
    pub symbol: String,
    /// Its unit.
    pub unit: Unit,
    /// What it is of the posterior.
    pub role: Role,
    /// Its prior, where it has one of its own.
    pub prior: Option<Distribution>,
    /// The reference value, where the study gives one.
    pub reference: Option<f64>,
    /// Posterior mean.
    pub mean: f64,
    /// Posterior standard deviation.
    pub sd: f64,
    /// The 2.5 % quantile.
    pub q025: f64,
    /// The median.
    pub median: f64,
    /// The 97.5 % quantile.
    pub q975: f64,
    /// The maximum of the posterior density.
    pub map: f64,
    /// Rank-normalised split R-hat.
    pub r_hat: f64,
    /// Bulk effective sample size.
    pub ess_bulk: f64,
    /// Tail effective sample size.
    pub ess_tail: f64,
    /// Monte Carlo standard error of the mean.
    pub mcse_mean: f64,
    /// Integrated autocorrelation time in steps.
    pub autocorrelation_time: f64,
    /// Named distributions fitted to the marginal, best first.
    pub fits: Vec<FittedDistribution>,
}

/// A named distribution fitted to a marginal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FittedDistribution {
    /// The distribution.
    pub distribution: Distribution,
    /// The Kolmogorov-Smirnov distance.
    pub ks: f64,
    /// The p-value of that distance at the effective sample size.
    pub p_value: f64,
    /// Akaike's criterion relative to the best of the list.
    pub delta_aic: f64,
}

/// The calibrated simulation against the data.
#[derive(Debug, Clone, PartialEq)]
pub struct ValidationFindings {
    /// What was compared: the MAP, the reference parameters.
    pub cases: Vec<ValidationCase>,
    /// For each value of the layout: how many replicates, their mean and standard deviation.
    pub replicates: Vec<(usize, f64, f64)>,
    /// The posterior predictive 95 % band, lower and upper.
    pub predictive: Option<(Vec<f64>, Vec<f64>)>,
    /// The standard deviation of a new replicate by origin, root mean square over outputs, in the response's unit.
    pub spread: Vec<(String, f64)>,
}

/// One set of parameters against the data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ValidationCase {
    /// Its name: `map`, `reference`.
    pub name: String,
    /// The parameters, in the study's order.
    pub point: Vec<f64>,
    /// The response: simulated when the model was run again, else emulated.
    pub response: Vec<f64>,
    /// Whether the model itself was run.
    pub simulated: bool,
    /// Share of points inside the replicates' 95 % interval, for each group.
    pub accuracy: Vec<(String, f64)>,
    /// Mean of the groups' accuracies.
    pub average: f64,
    /// Root mean square difference from the replicates' mean, in the response's unit.
    pub rmse: f64,
}
