//! A study as it is written: the engine's own sections and keys.
//!
//! A section that chooses a plugin with `use` has keys of the engine's, which stand here, beside
//! the plugin's own options.

mod cases;
mod sampler;

use std::collections::BTreeMap;
use std::path::PathBuf;

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::On;
use lacuna::text::file_name::FileName;
use lacuna::text::values::{AllowFailed, Count, Name, Positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use super::dependence::Prior;
pub use super::derived::DerivedSection;
pub use super::fidelity::{LowFidelitySection, NumericalErrorSection};
pub use super::hierarchy::{CoordinatesKey, PopulationKeys, ScatterKeys};
pub use super::noise::{InstrumentNoise, NoiseSection};
pub use super::scenario::{FunctionSection, ScenarioSection};
pub use cases::{CasesKeys, CasesOf};
pub use lacuna::text::quantity::Quantity;
pub use lacuna::text::response::{Axes, AxisSection, GridSection, ResponseSection};
pub use sampler::{SamplerKeys, StopRule};

/// Tables inside a section that a study may leave out: `false` takes out what another study has.
pub(super) const OPTIONAL: [(&str, &str); 3] =
    [("measurements", "screen"), ("surrogate", "refine"), ("sampler", "stop")];

/// Title, name, random seed and notes of the study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StudySection {
    /// Title of the study: one line that says what it is about.
    pub title: String,
    /// Name of the study, used as the name of its run directory; a plain file name, not a path. Default: the name of
    /// the study file without its extension.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<FileName>,
    /// Seed of all random number streams. Two runs with the same seed and the same study give the same results.
    #[serde(default)]
    pub seed: u64,
    /// Folder from which relative paths in the study start, itself relative to the folder of the study file. Default:
    /// the folder of the study file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub directory: Option<std::path::PathBuf>,
    /// Remark printed in the report for its readers, such as that the model or the data are a stand-in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

/// An unknown parameter of the model, which the calibration determines.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ParameterSection {
    /// Name of the parameter: that of the model input it sets, or a name used in the expressions of `computed` in
    /// `[model]`.
    pub name: Name,
    /// Scenario the parameter belongs to, such as the initial state of one record. `"each"` creates one parameter per
    /// scenario, called `name[scenario]`. Default: one parameter shared by all scenarios.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<String>,
    /// Label of the scenarios by which the parameter has values of its own, such as `target`: one value, called
    /// `name[T24]`, for each value of the label. `"scenario"` makes each scenario a group. With a surrogate the runs vary one
    /// value for all groups, and scenarios with the same conditions share them. Default: no groups.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<String>,
    /// Distribution from which the values of the groups are drawn, in place of `prior`. Its own unknowns are estimated, so that
    /// the groups inform each other as far as their data agree. Default: the groups are independent, each with `prior`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub population: Option<PopulationKeys>,
    /// Coordinates in which the values of a population are sampled: `"auto"`, `"centred"` or `"non_centred"`. They affect how
    /// well a sampler moves, and not the posterior.
    #[serde(default, skip_serializing_if = "CoordinatesKey::is_auto")]
    pub coordinates: CoordinatesKey,
    /// True if the data of this study must not update the parameter, because a model that is known to be wrong would
    /// distort it: its posterior is its prior, which may be the posterior of an earlier run, and the other parameters have
    /// their posterior given each of its values (cut distribution, modular Bayesian analysis).
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub cut: bool,
    /// Symbol used in figures, such as `x1`. Default: the name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub symbol: Option<String>,
    /// Unit of the parameter's `prior`, `design` and `reference`, such as `kg/m3`.
    #[serde(default = "Unit::dimensionless")]
    pub unit: Unit,
    /// Distribution from which the parameter's values in the simulation runs are drawn, in the parameter's unit; the
    /// surrogate is trained on its range. Default: the prior, widened by `margin` of `[design]` if that is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub design: Option<Distribution>,
    /// Prior distribution of the parameter in the calibration, in its unit. With a surrogate, the central 95 % of it
    /// must lie inside `design`. `{ posterior = "runs/a" }` is the posterior of an earlier run, joint with all parameters that
    /// name the same run. `{ interval = [1, 2] }` states bounds and no distribution, in a study without data. A share of a
    /// Dirichlet distribution in `[[dependence]]` needs none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<Prior>,
    /// Reference value from the literature or from practice, in the parameter's unit. It is compared with the posterior
    /// and does not enter the calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<f64>,
}

/// The engine's keys of `[model]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ModelKeys {
    /// Values of model inputs that are not calibrated: numbers in the model's units, or with a unit as in
    /// `{ value = 20, unit = "degC" }`. Default: the model's own default of each input.
    pub fixed: BTreeMap<String, Quantity>,
    /// Model inputs computed from parameters and from the values of scenarios, by expressions such as
    /// `{ damping = "base + slope * gas_fraction" }`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub computed: BTreeMap<String, String>,
    /// Name of the input that receives the seed of a run, for a model whose response is random: a whole number from 1 to
    /// 2147483647 that depends on the seed of the study, the inputs of the run and, if a likelihood is estimated from
    /// several runs, the number of the run among them. The same inputs and the same seed must give the same response.
    /// Default: the model is deterministic.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<Name>,
}

/// The engine's keys of `[design]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DesignKeys {
    /// Number of simulation runs.
    pub runs: Count,
    /// Numbers of runs added later, in order: `[97]` adds 97 runs and keeps the existing ones with their results.
    /// `lacuna campaign extend RUN --runs 97` appends to this list in a run directory.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub extended: Vec<Count>,
    /// Folders with finished runs to use in addition, relative to the study file: those that
    /// `lacuna campaign import RUN TABLE` makes from runs performed by hand, or the folder `2-simulate` of another run
    /// directory.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub imports: Vec<PathBuf>,
    /// Margin of the design around the prior, as a fraction of the prior's range: each uniform or log-uniform prior is
    /// widened by this fraction at both ends (on the logarithmic scale for a log-uniform prior) to form the `design` of
    /// every parameter that gives none. An emulator is least accurate at the edge of its training runs; a margin moves
    /// that edge outside the prior. The model must give results there. Default: no margin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margin: Option<Positive>,
    /// Number of runs that may fail: a fraction if below 1, a count from 1 on. They are left out of the training; more of
    /// them stop the study. A study with `[simulations]` says so there.
    #[serde(default, skip_serializing_if = "AllowFailed::is_none")]
    pub allow_failed: AllowFailed,
}

impl DesignKeys {
    /// Number of runs that the design places, including those added later.
    pub fn total(&self) -> usize {
        let more = self.extended.iter().map(|count| count.get());
        more.fold(self.runs.get(), usize::saturating_add)
    }
}

/// The engine's keys of `[simulations]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SimulationKeys {
    /// Treatment of runs whose parameters lie outside the declared `design`.
    pub outside_design: OutsideDesign,
}

/// Treatment of runs outside the declared design.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OutsideDesign {
    /// The program stops and lists these runs: either the design or the table of runs is wrong.
    #[default]
    Refuse,
    /// These runs are used like all others, and the assessment mentions them.
    Allow,
}

/// Treatment of runs outside the model's range of validity.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InvalidRuns {
    /// These runs are excluded from training and validation of the surrogate.
    #[default]
    LeaveOut,
    /// These runs are used like all others, and the assessment mentions them.
    Train,
}

/// The engine's keys of `[measurements]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct MeasurementKeys {
    /// Screening of the measurements for faulty curves. Default: no screening.
    pub screen: Option<Screen>,
    /// Summary curves of the replicates added to the data of each group: `mean`, `q025`, `q975`. The founding paper
    /// adds all three. They count the same information twice, so use them only to reproduce such an analysis. Default:
    /// none.
    pub added_curves: Vec<AddedCurve>,
    /// Noise of the instruments as their data sheets state it: `sd`, `resolution` and `memory`, each optional, in one
    /// table for all curves or in an array of tables with `on`. The search for missing physics (`lacuna gap STUDY`) uses it
    /// for curves without replicates; the calibration uses `[discrepancy]`. Default: estimated from the data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<InstrumentNoise>,
}

/// Screening for curves that deviate strongly from the other replicates of their group (groups of four curves or more).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Screen {
    /// Threshold above which a curve is flagged: its root mean square distance from the group's median curve,
    /// standardised by the median and the median absolute deviation of these distances.
    pub threshold: Positive,
    /// `true` excludes flagged curves from the calibration; `false` only lists them. The report lists them in either
    /// case.
    pub leave_out: bool,
}

impl Default for Screen {
    fn default() -> Self {
        let threshold = Positive::new(10.0).unwrap_or_else(|_| unreachable!("10 is positive"));
        Self { threshold, leave_out: true }
    }
}

/// A summary curve of the replicates of a group.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AddedCurve {
    /// Mean of the replicates.
    Mean,
    /// Lower end of the 95 % interval of a replicate: mean minus 1.96 standard deviations.
    Q025,
    /// Upper end of the 95 % interval of a replicate: mean plus 1.96 standard deviations.
    Q975,
}

/// The engine's keys of `[surrogate]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SurrogateKeys {
    /// Number of training runs, taken from the start of the design. Default: all runs but the `validation` runs.
    pub training: Option<Count>,
    /// Number of validation runs, taken from the end of the design: they are excluded from training and measure the
    /// surrogate's error.
    pub validation: usize,
    /// Treatment of runs that the model reports as outside its range of validity.
    pub invalid_runs: InvalidRuns,
    /// `true` asks the model for the derivatives of its response by the parameters at every training run, and fits the
    /// surrogate to values and derivatives: far fewer runs are then needed, above all with many parameters. The model must
    /// give derivatives, and the surrogate must take them. One derivative is compared with differences first, for two model
    /// runs more; a wrong one stops the study.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub gradients: bool,
    /// Sequential refinement: further runs after the calibration, placed where the posterior density and the emulator's
    /// error are large. Default: no refinement.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refine: Option<Refine>,
}

/// Sequential refinement: runs are added where the posterior density and the emulator's error are large, then the
/// surrogate is refitted and the study recalibrated, until the emulator's error is small compared with the discrepancy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Refine {
    /// Number of runs added in each round.
    pub runs: Count,
    /// Maximum number of rounds. Default: 5.
    #[serde(default = "Refine::rounds")]
    pub rounds: Count,
    /// Stopping criterion: refinement ends when the emulator's error at new runs near the posterior, measured before it
    /// is trained on them, is at most this fraction of the discrepancy of one replicate, both as root mean squares over
    /// the outputs. With `choose = "posterior_variance"` it is a fraction of the discrepancy of the mean of the
    /// replicates, which is smaller by the square root of their number. Default: 0.1.
    #[serde(default = "Refine::until")]
    pub until: Positive,
    /// Rule by which the points of the new runs are chosen.
    #[serde(default)]
    pub choose: Choose,
    /// Region in which the surrogate is fitted in each round.
    #[serde(default)]
    pub region: Region,
}

/// Rule by which the points of new runs near the posterior are chosen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Choose {
    /// One point after the other, each with the largest product of the emulator's error there and its distance from all
    /// runs, among draws of the posterior and an even cover of the region.
    #[default]
    EmulatorError,
    /// One point after the other, each with the smallest expected variance of the posterior density that the emulator
    /// leaves, integrated over the posterior: a run counts by what it will do to the posterior (Sürer, Plumlee and Wild,
    /// Technometrics 66 (2024) 162). It needs a surrogate that knows the covariance of its errors between points, such
    /// as `gaussian_process`; for others, and where the emulator's error is negligible, the rule is `emulator_error`.
    PosteriorVariance,
}

/// Region in which a refined surrogate is fitted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Region {
    /// A box around the posterior: the surrogate is fitted to the runs inside it and the posterior is restricted to it.
    /// The box is twice as wide as the posterior's 99.8 % intervals, and in the first round at least half as wide as
    /// the prior. Each round halves this minimum width, unless the posterior reaches an edge of the box, in which case
    /// the box only moves.
    #[default]
    Posterior,
    /// The whole design: the surrogate is fitted to all runs.
    Design,
}

impl Refine {
    fn rounds() -> Count {
        Count::new(5).unwrap_or_else(|_| unreachable!("5 is a count"))
    }
    fn until() -> Positive {
        Positive::new(0.1).unwrap_or_else(|_| unreachable!("0.1 is positive"))
    }
}

/// The engine's keys of `[discrepancy]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct DiscrepancyKeys {
    /// `true` includes the emulator's own error in the likelihood: a covariance, common to all replicates and
    /// correlated between outputs, estimated from the errors at runs excluded from the fit (cross-validation).
    pub emulator_error: bool,
    /// `true` includes the error that all points of a replicate share (its gain, its timing) in the likelihood: a
    /// covariance of the mean curve, estimated from the replicates. `false` treats all points as independent, which
    /// makes the posterior too narrow if they are not.
    pub replicate_error: bool,
    /// Populations of unknowns that the discrepancy has by group: `{ variance = { log_normal = { sd = { half_normal = 1 } } } }`.
    /// The values of the groups are then draws of one distribution, whose median has the prior of `variance`, so that groups with
    /// few data learn from the others. All groups of an unknown are members of one population. Default: the groups are
    /// independent.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub population: BTreeMap<String, ScatterKeys>,
}

impl Default for DiscrepancyKeys {
    fn default() -> Self {
        Self { emulator_error: true, replicate_error: true, population: BTreeMap::new() }
    }
}

/// The engine's keys of `[[effect]]`: a physical effect that the model lacks, with unknowns of its own that are
/// calibrated together with the model's parameters.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct EffectKeys {
    /// Name of the effect. The names of its unknowns begin with it, as in `damping.rate`. Default: the name of the
    /// plugin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<Name>,
    /// Part of the response the effect acts on: labels by axis, such as `{ sensor = ["R", "V"] }`. Default: the whole
    /// response.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub on: On,
    /// Label of the scenarios by which the effect has unknowns of its own, such as `target`: they are called
    /// `damping[T24].rate`, and are independent of each other unless they have a `population`. `"scenario"` makes each scenario
    /// a group. Default: the same unknowns everywhere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub by: Option<String>,
    /// Populations of the effect's unknowns: `{ rate = { log_normal = { sd = { half_normal = 0.5 } } } }`. The values of the groups
    /// are then draws of one distribution, whose mean, median or location has the prior of `rate`. Default: the groups are
    /// independent.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub population: BTreeMap<String, ScatterKeys>,
}

/// Checks performed after the calibration.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ValidateSection {
    /// `true` runs the model itself at the calibrated parameters; `false` uses the emulator's prediction. Default:
    /// `true` if the study has a model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rerun_model: Option<bool>,
    /// Values with which the calibrated parameters are compared. Default: no comparison.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub against: Option<Against>,
    /// Number of posterior draws at which the model is run to measure the emulator's error there. Default: 0, no check.
    pub emulator_check: usize,
}

/// Values with which calibrated parameters can be compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Against {
    /// The `reference` values of the parameters.
    Reference,
}
