//! `[forward]`: propagation of the priors through the model, in a study without data.

use lacuna::text::decode::decode;
use lacuna::text::{Complaints, Node, Problems};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::dependence::Sections;
use super::intervals::IntervalsSection;
use super::plain::Study;

/// Propagation of the priors of a study without measurements: the distribution of the response and of every
/// `[[quantity]]`, and the share of each parameter in their variance. A study without measurements that has a
/// `[[quantity]]` needs no such section.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ForwardSection {
    /// Number of draws from the priors. For `d` parameters the shares need `2 d` evaluations for each draw. Default:
    /// 10000 with a surrogate; 1000 without one, where each evaluation is a run of the model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub draws: Option<usize>,
    /// Search for the bounds of the quantities over the intervals of parameters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intervals: Option<IntervalsSection>,
}

/// Smallest number of draws from which shares of a variance and their errors can be estimated.
const FEWEST: usize = 100;

impl Study {
    /// Number of draws of the priors that are propagated; `None` in a study that has a posterior, or asks for nothing.
    pub fn propagated(&self) -> Option<usize> {
        let asks = self.forward.is_some() || !self.quantities.is_empty();
        let known = self.target.is_some() || self.measurements.is_some();
        let default = if self.surrogate.is_some() { 10_000 } else { 1000 };
        let written = self.forward.as_ref().and_then(|section| section.draws);
        (asks && !known).then(|| written.unwrap_or(default))
    }
}

/// Decodes `[forward]`; `None` if it is not written, or wrong, which is reported.
pub(super) fn forward(root: &Node, problems: &mut Problems) -> Option<ForwardSection> {
    let node = root.get("forward")?;
    problems.within("forward", |problems| decode(node, problems))
}

/// Reports a section that has no use, too few draws, and priors whose shares are not defined by independent draws.
pub(super) fn check(study: &Study, complaints: &mut Complaints<'_>) {
    if study.propagated().is_some() && !study.prior().is_independent() {
        let Sections { dependence, constraint, .. } = &study.dependence_sections;
        let place = match (dependence.is_empty(), constraint.is_empty()) {
            (false, _) => "dependence",
            (true, false) => "constraint",
            (true, true) => "parameter",
        };
        complaints
            .at(place)
            .say("priors that depend on each other are not propagated")
            .expected("independent priors in a study without `[measurements]`");
    }
    let Some(section) = &study.forward else { return };
    if study.measurements.is_some() {
        complaints
            .at("forward")
            .say("a study with `[measurements]` has no use for `[forward]`")
            .help("it predicts from its posterior: take one of the two out");
    }
    if let Some(draws) = section.draws.filter(|draws| *draws < FEWEST) {
        complaints
            .at("forward.draws")
            .say("too few draws for shares of a variance and their errors")
            .expected(format!("at least {FEWEST}"))
            .found(draws);
    }
}
