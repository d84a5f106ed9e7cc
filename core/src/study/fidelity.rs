//! Runs of different cost: `[numerical_error]` and `[low_fidelity]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::decode::decode;
use super::file::ModelKeys;
use super::values::{Count, NonNegative, Positive};
use super::{Node, Problems};
use crate::plugin::registry::{NoKeys, Section, section};
use crate::plugin::{Model, Reader, Surrogate};

/// How the model's own numerical error is estimated: some runs of the design are repeated with finer numerics. What they
/// differ by is predicted from the parameters and added to the response, as far as that is better at runs that were
/// left out; the rest is a covariance in the likelihood, common to all replicates and correlated between outputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NumericalErrorSection {
    /// How many runs are repeated: of the design's runs inside the prior those that together lie nearest to all others.
    pub runs: Count,
    /// Options of `[model]` that make it finer, such as `{ numerics = { mesh = "fine" } }`.
    #[schemars(with = "std::collections::BTreeMap<String, serde_json::Value>")]
    pub model: toml::Table,
    /// How many times finer the repeated runs are, in each direction.
    #[serde(default = "NumericalErrorSection::ratio")]
    pub ratio: Positive,
    /// The order of convergence: the error falls with the `order`-th power of the cells' size. The difference between
    /// two meshes is not the whole error of the coarser: that is larger by `1 / (1 - ratio^-order)` (Richardson's
    /// extrapolation; Roache, J. Fluids Eng. 116 (1994) 405), which is 2 for the defaults. Shocks and contacts
    /// are of first order whatever the scheme. A large number takes the difference for the whole error.
    #[serde(default = "NumericalErrorSection::order")]
    pub order: Positive,
    /// Whether the difference is predicted and added to the response. `false` takes all of it as noise about zero.
    #[serde(default = "NumericalErrorSection::predict")]
    pub predict: bool,
    /// The standard deviation of what is extrapolated beyond the finer runs, as a share of it: no mesh has shown
    /// it. The default 0.5 has a 95 % interval from no extrapolation at all to twice of it. Counts where the difference
    /// is added to the response.
    #[serde(default = "NumericalErrorSection::extrapolation")]
    pub extrapolation: NonNegative,
    /// The surrogate that predicts the difference, as in `{ use = "gaussian_process" }`; that of `[surrogate]` when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<std::collections::BTreeMap<String, serde_json::Value>>")]
    pub surrogate: Option<toml::Table>,
}

impl NumericalErrorSection {
    fn ratio() -> Positive {
        Positive::new(2.0).unwrap_or_else(|_| unreachable!("2 is positive"))
    }

    fn order() -> Positive {
        Positive::new(1.0).unwrap_or_else(|_| unreachable!("1 is positive"))
    }

    fn predict() -> bool {
        true
    }

    fn extrapolation() -> NonNegative {
        NonNegative::new(0.5).unwrap_or_else(|_| unreachable!("0.5 is not negative"))
    }

    /// The whole numerical error over the difference of the repeated runs.
    pub fn whole(&self) -> f64 {
        1.0 / (1.0 - self.ratio.get().powf(-self.order.get()))
    }

    /// What a covariance is made with, for the hash of what is made with it: see [`Self::whole`], and the share of
    /// the extrapolated part.
    pub fn scales(&self) -> [f64; 2] {
        [self.whole(), self.extrapolation.get()]
    }
}

/// A second ensemble of cheaper runs of the same response, such as those of a coarser mesh. The surrogate is fitted to the cheap
/// runs, and what the study's own runs differ by is learned from these: `factor * cheap + difference`, each left-out
/// run deciding for each group of outputs what is used. With neither a factor nor a difference that helps the
/// surrogate is that of the study's own runs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LowFidelitySection {
    /// Options of `[model]` that make it cheaper, such as `{ numerics = { mesh = [10, 45] } }`: the cheap model is run at
    /// the points of the study's own runs, and at `runs` further ones.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<std::collections::BTreeMap<String, serde_json::Value>>")]
    pub model: Option<toml::Table>,
    /// How many further points the cheap model is run at, placed by `[design]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub runs: Option<Count>,
    /// A reader of finished cheap runs, in place of `model` and `runs`: `use` and its options, as in `[simulations]`.
    /// Runs with the very parameters of a run of the study's own are compared with it directly; for all others the
    /// emulator of the cheap runs answers.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<std::collections::BTreeMap<String, serde_json::Value>>")]
    pub simulations: Option<toml::Table>,
    /// The surrogate of the difference, as in `{ use = "gaussian_process" }`; that of `[surrogate]` when left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<std::collections::BTreeMap<String, serde_json::Value>>")]
    pub surrogate: Option<toml::Table>,
}

/// How the model's numerical error is estimated.
pub struct NumericalError {
    /// How many runs of the design are repeated.
    pub runs: usize,
    /// The model with finer numerics.
    pub model: Section<dyn Model, ModelKeys>,
    /// What predicts the difference, where it is not the study's surrogate.
    pub surrogate: Option<Section<dyn Surrogate, NoKeys>>,
    /// The section as it is written.
    pub written: NumericalErrorSection,
}

/// A second ensemble of cheaper runs.
pub struct LowFidelity {
    /// Where they come from.
    pub source: Cheap,
    /// What stands for the difference, where it is not the study's surrogate.
    pub surrogate: Option<Section<dyn Surrogate, NoKeys>>,
    /// The section as it is written.
    pub written: LowFidelitySection,
}

/// Where cheap runs come from.
pub enum Cheap {
    /// A model that is run at the study's own points and at so many others.
    Model(Box<Section<dyn Model, ModelKeys>>, usize),
    /// A reader of finished runs.
    Reader(Section<dyn Reader, NoKeys>),
}

impl LowFidelity {
    /// Whether its runs are made by a model.
    pub fn is_run(&self) -> bool {
        matches!(self.source, Cheap::Model(..))
    }
}

/// `[numerical_error]`: the study's model with some options changed.
pub(super) fn numerical_error(root: &Node, problems: &mut Problems) -> Option<NumericalError> {
    let node = root.get("numerical_error")?;
    problems.within("numerical_error", |problems| {
        let written: NumericalErrorSection = decode(node, problems)?;
        if written.ratio.get() <= 1.0 {
            let place = node.get("ratio").unwrap_or(node).place.clone();
            let found = written.ratio.get();
            problems
                .report(Some(place), "the finer runs are no finer")
                .expected("a `ratio` above 1")
                .found(found.to_string());
            return None;
        }
        let model = changed_model(root, node, "finer", problems)?;
        let surrogate = surrogate(node, problems)?;
        Some(NumericalError { runs: written.runs.get(), model, surrogate, written })
    })
}

/// `[low_fidelity]`: a reader of finished runs, or the study's model with some options changed.
pub(super) fn low_fidelity(root: &Node, problems: &mut Problems) -> Option<LowFidelity> {
    let node = root.get("low_fidelity")?;
    problems.within("low_fidelity", |problems| {
        let written: LowFidelitySection = decode(node, problems)?;
        let source = match (&written.model, &written.simulations, written.runs) {
            (Some(_), None, Some(runs)) => Cheap::Model(
                Box::new(changed_model(root, node, "at lower cost", problems)?),
                runs.get(),
            ),
            (None, Some(_), None) => {
                let reader = node.get("simulations")?;
                let reader = |problems: &mut Problems| section(reader, None, problems);
                Cheap::Reader(problems.within("simulations", reader)?)
            }
            _ => {
                problems
                    .report(
                        Some(node.place.clone()),
                        "it is not clear where the cheap runs come from",
                    )
                    .expected(
                        "`model` and `runs`, or `simulations` with the files of finished runs",
                    );
                return None;
            }
        };
        let surrogate = surrogate(node, problems)?;
        Some(LowFidelity { source, surrogate, written })
    })
}

/// The surrogate of a difference, where the section names one.
#[expect(clippy::option_option, reason = "wrong, absent, or there")]
fn surrogate(
    node: &Node,
    problems: &mut Problems,
) -> Option<Option<Section<dyn Surrogate, NoKeys>>> {
    let Some(node) = node.get("surrogate") else { return Some(None) };
    problems.within("surrogate", |problems| section(node, None, problems)).map(Some)
}

/// The study's model with the options in `model` of a section in the place of its own.
fn changed_model(
    root: &Node,
    node: &Node,
    how: &str,
    problems: &mut Problems,
) -> Option<Section<dyn Model, ModelKeys>> {
    let Some(base) = root.get("model") else {
        problems.report(Some(node.place.clone()), format!("the study has no model to run {how}"));
        return None;
    };
    let mut changed = base.clone();
    overlay(&mut changed, node.get("model")?);
    problems.within("model", |problems| section(&changed, None, problems))
}

/// Puts the values of `over` in the place of those of `base`, table by table.
fn overlay(base: &mut Node, over: &Node) {
    for (key, value) in over.entries() {
        match base.get_mut(&key.name) {
            Some(old) if !old.entries().is_empty() && !value.entries().is_empty() => {
                overlay(old, value);
            }
            _ => base.set(key.clone(), value.clone()),
        }
    }
}
