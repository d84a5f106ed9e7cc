//! A study as it is written: the engine's own sections and keys.
//!
//! A section that chooses a plugin with `use` has keys of the engine's, which stand here, beside
//! the plugin's own options.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use super::derived::DerivedSection;
pub use super::fidelity::{LowFidelitySection, NumericalErrorSection};
use super::file_name::FileName;
pub use super::quantity::Quantity;
pub use super::response::{Axes, AxisSection, GridSection, ResponseSection};
pub use super::scenario::{FunctionSection, ScenarioSection};
use super::values::{Count, Fraction, Name, Positive};
use crate::data::Unit;
use crate::math::distribution::Distribution;
use crate::plugin::effect::On;

/// What the study is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StudySection {
    /// One line that says what the study is about.
    pub title: String,
    /// The study's name, used for its run directory: a plain name, no path; the name of its file when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<FileName>,
    /// The seed of all random numbers.
    #[serde(default)]
    pub seed: u64,
    /// Where relative paths start; the folder of the study file when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub directory: Option<std::path::PathBuf>,
    /// What a reader of the report must know about the model and the data, such as that they are a stand-in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

/// An unknown of the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ParameterSection {
    /// The name of the model's input that it sets, or a name that the expressions of `computed` in `[model]` use.
    pub name: Name,
    /// The scenario to which it belongs, such as the initial state of one record; `"each"` makes one parameter a
    /// scenario, called `name[scenario]`. All scenarios share the parameter when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<String>,
    /// The symbol used in figures, such as `x1`; the name when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub symbol: Option<String>,
    /// The unit of all its values, such as `kg/m3`.
    #[serde(default = "Unit::dimensionless")]
    pub unit: Unit,
    /// Where the surrogate is trained; the prior when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub design: Option<Distribution>,
    /// Where the calibration looks.
    pub prior: Distribution,
    /// A value from the literature or from practice, to compare with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<f64>,
}

/// The engine's keys of `[model]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ModelKeys {
    /// Values of inputs that are not calibrated: numbers in the model's units, or with a unit as in
    /// `{ value = 20, unit = "degC" }`; its defaults when left out.
    pub fixed: BTreeMap<String, Quantity>,
    /// Inputs of the model as expressions of parameters and of the values of scenarios, such as
    /// `{ damping = "base + slope * gas_fraction" }`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub computed: BTreeMap<String, String>,
}

/// The engine's keys of `[design]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DesignKeys {
    /// The number of simulation runs.
    pub runs: Count,
    /// Numbers of runs that were added later, one after the other: `[97]` adds 97 without moving the others, whose
    /// results are kept. `lacuna campaign extend RUN --runs 97` adds to the list of a run directory.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub extended: Vec<Count>,
    /// Folders with finished runs that are used too, relative to the study file: those that `lacuna campaign import RUN TABLE`
    /// makes of runs made by hand, or the folder `2-simulate` of another run directory.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub imports: Vec<PathBuf>,
    /// By which share of its range each uniform or log-uniform prior is widened on either side to make the design of a parameter
    /// that gives none: an emulator is worst at the edge of its runs, and with a margin that edge is beyond the prior. The model must
    /// have answers there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margin: Option<Positive>,
}

impl DesignKeys {
    /// The number of runs that the design places, those added later too.
    pub fn total(&self) -> usize {
        let more = self.extended.iter().map(|count| count.get());
        more.fold(self.runs.get(), usize::saturating_add)
    }
}

/// The engine's keys of `[simulations]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SimulationKeys {
    /// What is done about runs outside the declared `design` of a parameter.
    pub outside_design: OutsideDesign,
}

/// What is done about runs outside the declared design.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OutsideDesign {
    /// They stop the run, which says which they are: either the design or the table is wrong.
    #[default]
    Refuse,
    /// They are used like all others, and the assessment says so.
    Allow,
}

/// What is done about runs outside the model's validity.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InvalidRuns {
    /// The surrogate is neither trained nor tested on them.
    #[default]
    LeaveOut,
    /// They are used like all others, and the assessment says so.
    Train,
}

/// The engine's keys of `[measurements]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct MeasurementKeys {
    /// How faulty curves are found.
    pub screen: Option<Screen>,
    /// Curves over the replicates that are added to the data of each group: `mean`, `q025`, `q975`. The founding
    /// paper adds all three; that counts the same information twice, so leave it out unless you mean to repeat it.
    pub added_curves: Vec<AddedCurve>,
}

/// Finds curves that are far from the other replicates of their group.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Screen {
    /// A curve is flagged when its robust distance from the median curve is above this many robust
    /// standard deviations of the distances.
    pub threshold: Positive,
    /// Whether flagged curves are left out of the calibration; they are listed in the report in any case.
    pub leave_out: bool,
}

impl Default for Screen {
    fn default() -> Self {
        let threshold = Positive::new(10.0).unwrap_or_else(|_| unreachable!("10 is positive"));
        Self { threshold, leave_out: true }
    }
}

/// A curve over the replicates of a group.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AddedCurve {
    /// The mean of the replicates.
    Mean,
    /// The lower end of their 95 % interval.
    Q025,
    /// The upper end of their 95 % interval.
    Q975,
}

/// The engine's keys of `[surrogate]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SurrogateKeys {
    /// The number of runs to train on, the first ones of the design; all but `validation` when left out.
    pub training: Option<Count>,
    /// The number of runs kept aside to measure the error, the last ones of the design.
    pub validation: usize,
    /// What is done about runs that the model calls outside its validity.
    pub invalid_runs: InvalidRuns,
    /// Further runs after the calibration, where posterior and emulator's error are large.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refine: Option<Refine>,
}

/// Sequential refinement: runs are added where the posterior and the emulator's error are large, the surrogate is fitted
/// and the study calibrated anew, until the emulator's error is small against the discrepancy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Refine {
    /// The number of runs added in each round.
    pub runs: Count,
    /// The most rounds; 5 when left out.
    #[serde(default = "Refine::rounds")]
    pub rounds: Count,
    /// Refinement ends when the emulator's error at new runs near the posterior, before it has learned from them, is
    /// at most this share of the discrepancy, as root mean squares over the outputs; 0.1 when left out.
    #[serde(default = "Refine::until")]
    pub until: Positive,
    /// Where the surrogate is fitted in each round.
    #[serde(default)]
    pub region: Region,
}

/// Where a refined surrogate is fitted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Region {
    /// In a box about the posterior, on the runs inside it; the posterior is kept to that box. The box is twice as wide
    /// as the posterior's 99.8 % intervals, and in the first round at least half as wide as the prior; each round
    /// halves that, unless the posterior meets an edge of the box: then the box only moves.
    #[default]
    Posterior,
    /// In the whole design, on all runs.
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
    /// Makes the emulator's own error a part of the likelihood: a covariance, common to all replicates and correlated
    /// between outputs, estimated from its errors at runs that were left out of the fit.
    pub emulator_error: bool,
    /// Whether what the points of a replicate share (its gain, its timing) is part of the likelihood: a covariance
    /// of the mean curve estimated from the replicates. Without it all points count as independent.
    pub replicate_error: bool,
}

impl Default for DiscrepancyKeys {
    fn default() -> Self {
        Self { emulator_error: true, replicate_error: true }
    }
}

/// The engine's keys of `[[effect]]`: a piece of physics that the model lacks, with unknowns of its own that are
/// calibrated together with the model's parameters.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct EffectKeys {
    /// Its name, which begins the names of its unknowns as in `damping.rate`; that of the plugin when left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<Name>,
    /// Where it acts: labels by axis, such as `{ sensor = ["R", "V"] }`; everywhere when left out.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub on: On,
}

/// The engine's keys of `[sampler]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SamplerKeys {
    /// The share of the first steps that is left out of every summary.
    pub burn_in: Fraction,
    /// Where the chains start; when left out, where the sampler starts best: about the maximum, unless its page says otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<Start>,
    /// Goes on after the sampler's own number of steps until this is reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stop: Option<StopRule>,
}

/// When a run has enough draws.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StopRule {
    /// The smallest effective sample size, in bulk and tails, of all unknowns after the burn-in.
    pub effective_sample_size: Count,
    /// The most steps of each chain; fifty times the sampler's own number when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_steps: Option<Count>,
}

impl Default for SamplerKeys {
    fn default() -> Self {
        let burn_in = Fraction::new(0.5).unwrap_or_else(|_| unreachable!("0.5 is a fraction"));
        Self { burn_in, start: None, stop: None }
    }
}

/// Where chains start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// Scattered about the optimised maximum of the posterior density by its curvature.
    Map,
    /// Independent draws from the prior. A wide prior is known to strand walkers.
    Prior,
    /// A Sobol' sequence through the prior, more even than independent draws.
    Sobol,
}

/// What is checked after the calibration.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ValidateSection {
    /// Whether the model itself is run again at the calibrated parameters (the emulator answers when not); when
    /// left out, it is if the study has a model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rerun_model: Option<bool>,
    /// What the calibrated parameters are compared with.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub against: Option<Against>,
    /// Number of posterior draws at which the model is run to measure the emulator's error there.
    pub emulator_check: usize,
}

/// What calibrated parameters are compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Against {
    /// The `reference` values of the parameters.
    Reference,
}
