//! The proof of the names on data that were not used: do they predict these where a free form in their place does not?

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{AddedEffect, GapResult, HeldOut};
use crate::gap::search::{CrossValidation, LeftOut, PROVEN, VerdictKind, decides};

/// Kind of a proof.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "GapProofKind")]
pub enum ProofKind {
    /// Conditions, sensors or blocks of the curves could be left out for every effect: a wrong name fails there.
    Transfer,
    /// Only replicates, which share the mean curve: they show that the gap is reproducible, and not that the effect
    /// holds elsewhere.
    Reproducible,
}

/// The proof of the names that a search gave.
#[derive(Debug, Clone, PartialEq)]
pub struct NameProof {
    /// The kind.
    pub kind: ProofKind,
    /// True when every effect predicts each kind of left-out data better than its rival, and no held-out data
    /// contradict the effects.
    pub passed: bool,
    /// The comparisons with the rivals.
    pub rivals: Vec<RivalComparison>,
}

/// The comparison of an effect with a free form in its place, on one kind of left-out data.
#[derive(Debug, Clone, PartialEq)]
pub struct RivalComparison {
    /// The name of the effect.
    pub effect: String,
    /// The log predictive density with the effect less that with its rival, summed over the parts, and its error.
    pub score: CrossValidation,
    /// True when the effect [is proven](CrossValidation::is_proven) to predict better; replicates beside other kinds only
    /// must not contradict it by 2.5 standard errors.
    pub passed: bool,
}

impl NameProof {
    /// The proof of a result; `None` if no effect was found.
    pub fn of(result: &GapResult, held_out: &[HeldOut]) -> Option<Self> {
        let certain = result.additions.iter().any(|effect| effect.certain);
        let has_names = result.verdict.word != VerdictKind::Unlisted || certain;
        let is_name = |effect: &&AddedEffect| {
            result.verdict.word != VerdictKind::Unlisted || !certain || effect.certain
        };
        let names: Vec<&AddedEffect> = result.additions.iter().filter(is_name).collect();
        let elsewhere = |one: &CrossValidation| one.left_out != LeftOut::Replicate;
        let transfers = |effect: &&AddedEffect| effect.rivals.iter().any(elsewhere);
        let kind = match names[..] {
            [] => return None,
            _ if names.iter().all(transfers) => ProofKind::Transfer,
            _ => ProofKind::Reproducible,
        };
        let compared = |effect: &AddedEffect| -> Vec<RivalComparison> {
            let each = effect.rivals.iter().map(|score| RivalComparison {
                effect: effect.name.clone(),
                score: score.clone(),
                passed: passed(score, &effect.rivals),
            });
            each.collect()
        };
        let rivals: Vec<RivalComparison> = names.into_iter().flat_map(compared).collect();
        let is_tested = !rivals.is_empty() || !held_out.is_empty();
        let passed = has_names
            && is_tested
            && rivals.iter().all(|rival| rival.passed)
            && contradiction(held_out).is_none();
        Some(Self { kind, passed, rivals })
    }
}

/// True when an effect predicts left-out data better than its rival; data that do not decide only must not contradict it.
fn passed(score: &CrossValidation, all: &[CrossValidation]) -> bool {
    if decides(score, all) { score.is_proven() } else { score.is_better(-PROVEN) }
}

/// The reason, in words, for which held-out data contradict effects: the gap grew, or the interval of the share that
/// closed holds zero; `None` if they do not. A part without a visible gap says nothing beside others.
pub fn contradiction(held_out: &[HeldOut]) -> Option<String> {
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let against = |part: &HeldOut| {
        let (all, kind) = (&part.proof.all, part.kind.words());
        if all.upper < 0.0 || all.closed <= 0.0 && all.lower.is_finite() {
            return Some(format!(
                "on held-out {kind} the gap grew: {:.2} standard deviations of the noise without the effects, {:.2} with them",
                all.before, all.after
            ));
        }
        (all.lower.is_finite() && all.lower <= 0.0).then(|| {
            let [lower, upper] = [all.lower, all.upper].map(percent);
            format!(
                "on held-out {kind} the 95 % interval of the share of the gap that closed holds zero: {lower} to {upper}"
            )
        })
    };
    if let Some(reason) = held_out.iter().find_map(against) {
        return Some(reason);
    }
    let shows = held_out.is_empty() || held_out.iter().any(|part| part.proof.all.lower > 0.0);
    (!shows).then(|| {
        let kinds: Vec<&str> = held_out.iter().map(|part| part.kind.words()).collect();
        format!("held-out {} do not show that the gap shrank", kinds.join(" and "))
    })
}

impl GapResult {
    /// The effects that a study may add: those that have a name, unless held-out data contradict them. Nothing is added
    /// beside another model that is not.
    pub fn worth_adding(&self) -> Vec<AddedEffect> {
        if contradiction(&self.held_out).is_some() {
            return Vec::new();
        }
        let is_named = |effect: &AddedEffect| match self.verdict.word {
            VerdictKind::Named | VerdictKind::Approximate | VerdictKind::Class => true,
            VerdictKind::Unlisted => effect.certain,
            VerdictKind::None | VerdictKind::NotVisible => false,
        };
        if self.additions.first().is_some_and(|first| first.model && !is_named(first)) {
            return Vec::new();
        }
        self.additions.iter().filter(|effect| is_named(effect)).cloned().collect()
    }

    /// The reason, in words, for which effects that were found are not added; `None` if all are.
    pub fn not_added(&self) -> Option<String> {
        let added = self.worth_adding();
        let left: Vec<String> = self
            .additions
            .iter()
            .filter(|effect| !added.iter().any(|other| other.name == effect.name))
            .map(|effect| format!("`{}`", effect.name))
            .collect();
        if left.is_empty() {
            return None;
        }
        let verb = if left.len() == 1 { "is" } else { "are" };
        let names = left.join(" and ");
        let reason = contradiction(&self.held_out)
            .unwrap_or_else(|| "what is missing has no sure name".to_owned());
        Some(format!("{names} {verb} not added to the study: {reason}"))
    }

    /// True when no remainder is significant beside the effects.
    pub fn is_exact(&self) -> bool {
        match self.verdict.word {
            VerdictKind::Named | VerdictKind::Class => true,
            VerdictKind::Approximate => false,
            VerdictKind::Unlisted | VerdictKind::None | VerdictKind::NotVisible => {
                let [score, scan, energy] = self.p[1];
                let [naming, unlisted] = self.levels;
                score > naming && scan.min(energy) > 0.5 * unlisted && self.remains.is_none()
            }
        }
    }

    /// A warning for those who read the parameters; `None` if what is missing has a name, or nothing is.
    pub fn warning(&self) -> Option<&'static str> {
        (self.verdict.word == VerdictKind::Unlisted).then_some(
            "something is missing that has no sure name: the calibrated parameters make up for it and may be farther from \
             the truth than their standard deviations say",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gap::experiment::hold_out::HeldOutKind;
    use crate::gap::prove::{Closing, Comparison, Proof};

    fn part(kind: HeldOutKind, closed: f64, interval: [f64; 2]) -> HeldOut {
        let [lower, upper] = interval;
        let beyond_known_errors =
            Closing { before: 1.0, after: 0.5, closed: [closed, lower, upper] };
        let all = Comparison {
            before: 1.0,
            after: (1.0 - closed).max(0.0).sqrt(),
            closed,
            lower,
            upper,
            beyond_known_errors,
            replicates: 3,
        };
        let shrank = lower > 0.0;
        let (rmse, coverage) = ([1.0, 0.5], [0.9, 0.95]);
        let proof = Proof { all, conditions: Vec::new(), rmse, coverage, log_score: 1.0, shrank };
        HeldOut { kind, names: Vec::new(), proof, accuracy: None }
    }

    /// Held-out data contradict an effect if the gap grew, if the interval of the share closed holds zero, or if no part
    /// shows that it closed; a part without a visible gap says nothing beside one that shows it.
    #[test]
    fn held_out_data_contradict_what_they_do_not_show() {
        let (replicates, scenarios) = (HeldOutKind::Replicates, HeldOutKind::Scenarios);
        let (inf, says) = (f64::INFINITY, |parts: &[HeldOut]| contradiction(parts));
        let closes = || part(replicates, 0.8, [0.6, 0.95]);
        assert_eq!(says(&[]), None);
        assert_eq!(says(&[closes()]), None);
        assert_eq!(says(&[part(replicates, 0.9, [0.3, inf])]), None);
        assert_eq!(says(&[closes(), part(scenarios, -0.1, [-inf, inf])]), None);
        let grew = says(&[part(replicates, -0.4, [-0.9, -0.1])]).unwrap();
        assert!(grew.contains("the gap grew: 1.00 standard deviations"), "{grew}");
        assert!(says(&[part(replicates, -1.0, [-inf, -0.1])]).unwrap().contains("grew"));
        let zero = says(&[part(replicates, 0.4, [-0.2, 0.8])]).unwrap();
        assert!(zero.ends_with("holds zero: -20 % to 80 %"), "{zero}");
        assert!(
            says(&[closes(), part(scenarios, 0.4, [-0.2, 0.8])]).unwrap().contains("scenarios")
        );
        let nothing = says(&[part(replicates, 0.5, [-inf, inf])]).unwrap();
        assert_eq!(nothing, "held-out replicates do not show that the gap shrank");
    }
}
