//! The keys of the proof of the names, and of the members of a class.

use schemars::JsonSchema;
use serde::Serialize;

use crate::gap::result::added::{Averaged as Mixture, MemberRun};
use crate::gap::result::members::Member as Found;
use crate::gap::result::names::{NameProof, ProofKind, RivalComparison};
use crate::gap::search::LeftOut;
use crate::report::summary::value::{ByName, Quantity};

/// Proof of the names on data that were not used.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Proof {
    /// Kind of the proof.
    pub kind: ProofKind,
    /// True if every effect predicts each kind of left-out data better than its rival, and no held-out data contradict
    /// the effects.
    pub passed: bool,
    /// Comparisons of each effect with its rival: a free form in its place, or for another model the study's model with
    /// its effects.
    pub rivals: Vec<Rival>,
}

/// Comparison of an effect with its rival on one kind of left-out data.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Rival {
    /// Name of the effect.
    pub effect: String,
    /// Kind of the parts that were left out in turn.
    pub left_out: LeftOut,
    /// Number of parts.
    pub parts: usize,
    /// Log predictive density of the left-out data with the effect, minus that with its rival.
    pub difference: Quantity,
    /// Standard error of the difference; `null` if there are too few parts.
    pub error: Option<f64>,
    /// True if the effect predicts better, by 2.5 standard errors.
    pub passed: bool,
}

/// Member of the class: effects that the data cannot tell from those of the other members.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Member {
    /// Types of its effects, joined by ` + `.
    #[serde(rename = "type")]
    pub kind: String,
    /// Posterior probability among the members.
    pub weight: f64,
    /// File of the study with its effects; only if it was run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub study: Option<String>,
    /// Run directory of that study; only if it was run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
    /// Posterior of its parameters and of the unknowns of its effects; empty if it was not run.
    #[schemars(extend("propertyNames" = { "title": "parameter" }))]
    pub parameters: ByName<MemberPosterior>,
}

/// Posterior of a parameter in the study of one member.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct MemberPosterior {
    /// Posterior mean.
    pub mean: Quantity,
    /// Posterior standard deviation.
    pub sd: f64,
    /// Unit of the parameter.
    pub unit: String,
}

/// Posterior averaged over the members by their weights: the mixture of their posteriors.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Averaged {
    /// Mean of the mixture.
    pub mean: Quantity,
    /// Standard deviation of the mixture.
    pub sd: f64,
    /// 2.5 % quantile of the mixture.
    pub q025: f64,
    /// Median of the mixture.
    pub median: f64,
    /// 97.5 % quantile of the mixture.
    pub q975: f64,
    /// Unit of the parameter.
    pub unit: String,
}

impl Proof {
    pub fn of(proof: &NameProof) -> Self {
        let rivals = proof.rivals.iter().map(Rival::of).collect();
        Self { kind: proof.kind, passed: proof.passed, rivals }
    }
}

impl Rival {
    fn of(rival: &RivalComparison) -> Self {
        Self {
            effect: rival.effect.clone(),
            left_out: rival.score.left_out,
            parts: rival.score.parts,
            difference: rival.score.difference.into(),
            error: rival.score.error,
            passed: rival.passed,
        }
    }
}

impl Member {
    /// A member with the run of its study, if there is one.
    pub fn of(found: &Found, runs: &[MemberRun]) -> Self {
        let run = runs.iter().find(|run| run.kinds == found.kinds);
        let posterior = |p: &crate::gap::result::added::UnknownPosterior| {
            let own = MemberPosterior { mean: p.mean.into(), sd: p.sd, unit: p.unit.to_string() };
            (p.name.clone(), own)
        };
        Self {
            kind: found.kinds.join(" + "),
            weight: found.weight,
            study: run.map(|run| run.study.display().to_string()),
            run: run.map(|run| run.run.display().to_string()),
            parameters: run.iter().flat_map(|run| &run.unknowns).map(posterior).collect(),
        }
    }
}

impl Averaged {
    pub fn of(mixture: &Mixture) -> Self {
        Self {
            mean: mixture.mean.into(),
            sd: mixture.sd,
            q025: mixture.q025,
            median: mixture.median,
            q975: mixture.q975,
            unit: mixture.unit.to_string(),
        }
    }
}
