//! Runs of different cost: `[numerical_error]` and `[low_fidelity]`.

use lacuna::plugin::registry::{NoKeys, Section, section};
use lacuna::plugin::{Model, Reader, Surrogate};
use lacuna::text::decode::decode;
use lacuna::text::values::{Count, NonNegative, Positive};
use lacuna::text::{Node, Problems};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::file::ModelKeys;

/// Estimation of the model's numerical error from runs of the design that are repeated with finer numerics. The
/// difference is predicted from the parameters and added to the response if this reduces the error at left-out runs;
/// the rest is a covariance in the likelihood, common to all replicates and correlated between outputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NumericalErrorSection {
    /// Number of runs that are repeated: those of the design's runs inside the prior that together lie nearest to all
    /// others.
    pub runs: Count,
    /// Options of `[model]` to change for the finer runs, such as `{ numerics = { mesh = "fine" } }`.
    #[schemars(with = "std::collections::BTreeMap<String, serde_json::Value>")]
    pub model: toml::Table,
    /// Refinement ratio of the repeated runs in each direction.
    #[serde(default = "NumericalErrorSection::ratio")]
    pub ratio: Positive,
    /// Order of convergence: the error is proportional to the cell size to the power `order`. The difference between
    /// two meshes is smaller than the error of the coarser one, which is `1 / (1 - ratio^-order)` times larger
    /// (Richardson's extrapolation; Roache, J. Fluids Eng. 116 (1994) 405): a factor of 2 for the defaults. Shocks and
    /// contacts are of first order whatever the scheme. A large number takes the difference for the whole error.
    #[serde(default = "NumericalErrorSection::order")]
    pub order: Positive,
    /// Predict the difference and add it to the response. With `false`, all of it is treated as noise about zero.
    #[serde(default = "NumericalErrorSection::predict")]
    pub predict: bool,
    /// Standard deviation of the extrapolation beyond the finer runs, as a share of it, because no mesh has confirmed
    /// it. The default 0.5 has a 95 % interval from no extrapolation to twice of it. Used only if the difference is
    /// added to the response.
    #[serde(default = "NumericalErrorSection::extrapolation")]
    pub extrapolation: NonNegative,
    /// Surrogate that predicts the difference, such as `{ use = "gaussian_process" }`. Default: the surrogate of
    /// `[surrogate]`.
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

    /// Factor from the difference of the repeated runs to the whole numerical error.
    pub fn whole(&self) -> f64 {
        1.0 / (1.0 - self.ratio.get().powf(-self.order.get()))
    }

    /// Factors of the covariance, for the hash of results made with it: [`Self::whole`], and the share of the
    /// extrapolated part.
    pub fn scales(&self) -> [f64; 2] {
        [self.whole(), self.extrapolation.get()]
    }
}

/// A second ensemble of cheaper runs of the same response, such as those of a coarser mesh. The surrogate is fitted to
/// the cheap runs, and the difference of the study's own runs is learned as `factor * cheap + difference`; left-out
/// runs decide for each group of outputs which of the two is used. If neither a factor nor a difference reduces the
/// error, the surrogate is fitted to the study's own runs only.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LowFidelitySection {
    /// Options of `[model]` that make it cheaper, such as `{ numerics = { mesh = [10, 45] } }`: the cheap model is run
    /// at the points of the study's own runs, and at `runs` further points.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<std::collections::BTreeMap<String, serde_json::Value>>")]
    pub model: Option<toml::Table>,
    /// Number of further points at which the cheap model is run, placed by `[design]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub runs: Option<Count>,
    /// A reader of finished cheap runs, in place of `model` and `runs`: `use` and its options, as in `[simulations]`.
    /// Runs with exactly the parameters of one of the study's own runs are compared with it directly; for all others
    /// the emulator of the cheap runs is used.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<std::collections::BTreeMap<String, serde_json::Value>>")]
    pub simulations: Option<toml::Table>,
    /// Surrogate of the difference, such as `{ use = "gaussian_process" }`. Default: the surrogate of `[surrogate]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<std::collections::BTreeMap<String, serde_json::Value>>")]
    pub surrogate: Option<toml::Table>,
}

/// Estimation of the model's numerical error.
pub struct NumericalError {
    /// Number of runs of the design that are repeated.
    pub runs: usize,
    /// The model with finer numerics.
    pub model: Section<dyn Model, ModelKeys>,
    /// The surrogate of the difference; `None` for that of the study.
    pub surrogate: Option<Section<dyn Surrogate, NoKeys>>,
    /// The section as written.
    pub written: NumericalErrorSection,
}

/// `[low_fidelity]`, ready to be run.
pub struct LowFidelity {
    /// Source of the cheap runs.
    pub source: Cheap,
    /// The surrogate of the difference; `None` for that of the study.
    pub surrogate: Option<Section<dyn Surrogate, NoKeys>>,
    /// The section as written.
    pub written: LowFidelitySection,
}

/// Source of cheap runs.
pub enum Cheap {
    /// A model that is run at the study's own points and at this number of further ones.
    Model(Box<Section<dyn Model, ModelKeys>>, usize),
    /// A reader of finished runs.
    Reader(Section<dyn Reader, NoKeys>),
}

impl LowFidelity {
    /// Returns true if the runs are made by a model.
    pub fn is_run(&self) -> bool {
        matches!(self.source, Cheap::Model(..))
    }
}

/// `[numerical_error]`: the study's model with some options changed.
pub(in crate::study) fn numerical_error(
    root: &Node,
    problems: &mut Problems,
) -> Option<NumericalError> {
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

/// The surrogate of a difference, if the section names one.
#[expect(clippy::option_option, reason = "wrong, absent, or there")]
fn surrogate(
    node: &Node,
    problems: &mut Problems,
) -> Option<Option<Section<dyn Surrogate, NoKeys>>> {
    let Some(node) = node.get("surrogate") else { return Some(None) };
    problems.within("surrogate", |problems| section(node, None, problems)).map(Some)
}

/// The study's model with the options in `model` of a section in place of its own.
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

/// Replaces the values of `base` by those of `over`, table by table.
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
