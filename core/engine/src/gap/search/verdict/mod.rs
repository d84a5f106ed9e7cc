//! The verdict: no gap, a named effect, a class of effects, an unlisted effect, or no effect that this experiment could
//! show.

mod class;
mod grounds;
mod probability;
mod reliability;

use lacuna::plugin::effect::{On, Placed};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::diagnostics::{SearchOptions, SearchResult};
use crate::gap::candidates::Candidate;
use crate::gap::test::is_at_floor;
use class::{alike, widened};
use grounds::Grounds;

pub use class::class;
pub use grounds::explains;
pub use probability::{CEILING, Traits};
pub use reliability::{Bin, Brier, Reliability, Told};

/// Smallest posterior probability at which a type is named alone, and which the types of a class reach together: about 20 to 1,
/// strong evidence by Kass and Raftery (Journal of the American Statistical Association 90 (1995) 773).
pub const SURE: f64 = 0.95;

/// Smallest share of replicates without which the type stays the same.
const STABLE: f64 = 0.8;

/// The level at which an effect is found to differ between conditions or sensors.
const INCONSISTENT: f64 = 0.001;

/// The share of the excess misfit that effects must close to explain it, with no significant energy left.
const NEARLY: f64 = 0.9;

/// The level at which the energy that is left is significant.
const REMAINS: f64 = 0.05;

/// The share of the excess misfit that an effect must close to be named if an excess remains.
const HALF: f64 = 0.5;

/// The share of the gap that the effects of an approximate name close at least. In a prototype by others, single terms of the right
/// type closed 92 to 94 % of the gap of physics inside a simulator, single effects of a wrong type up to 80 %.
const MOST: f64 = 0.8;

/// The largest number of types that explain as much, none of them exact, that still are a name.
const FEW: usize = 3;

/// The log Bayes factor of a remainder above which it is significant: 20 to 1 (Kass and Raftery, Journal of the American
/// Statistical Association 90 (1995) 773).
const SIGNIFICANT: f64 = 3.0;

/// The smallest probability at which a type or class is named: a name that is more often wrong than right is none.
const LIKELY: f64 = 0.5;

/// The number of standard errors by which a free form in the place of an effect has to predict left-out data better to
/// contradict it.
const CONTRADICTED: f64 = 2.0;

/// The number of standard errors by which an effect beside which another part of the gap has no name has to predict left-out
/// data better than a free form in its place.
const CERTAIN: f64 = 4.0;

/// The 95 % quantile of the normal distribution: an excess of so many standard deviations is clear.
pub(super) const CLEAR: f64 = 1.645;

/// The absorbed share of a candidate above which it counts as not visible.
const INVISIBLE: f64 = 0.95;

/// Verdict of a search, as written in `summary.json`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "GapVerdict")]
pub enum VerdictKind {
    /// Data and model agree within noise and the emulator's error.
    None,
    /// The missing effects are named: with them nothing is left that the data can show.
    Named,
    /// The missing effects act like those named, which explain most of the gap; a remainder is significant.
    Approximate,
    /// A missing effect is one of a class of types that these data cannot distinguish.
    Class,
    /// The data show a gap that no candidate explains.
    Unlisted,
    /// The data show no gap, but the calibrated parameters would absorb nearly all of any candidate.
    NotVisible,
}

/// An effect that is missing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MissingEffect {
    /// The name in the system.
    pub name: String,
    /// The name of its plugin.
    pub kind: String,
    /// Labels on which it acts, by axis; empty for all.
    pub on: On,
    /// The values of its unknowns, in their units.
    pub values: Vec<f64>,
    /// The standard deviations.
    pub sd: Vec<f64>,
    /// The probability that its type is right, as counted in cases of which half hide what no candidate is; never above
    /// [`CEILING`].
    pub probability: f64,
    /// The posterior probability of its type among the candidates, as if one of them were exactly true.
    #[serde(default)]
    pub posterior_probability: f64,
    /// The quantities from which its probability follows; `None` for another model.
    #[serde(default)]
    pub traits: Option<Traits>,
    /// The types that these data cannot distinguish from it, itself first; itself alone if they can.
    pub class: Vec<String>,
    /// The share of the gap that it closes beside the other effects.
    pub share: f64,
    /// True when it closes most of the misfit on its sensors and predicts left-out data better than a free form in its
    /// place.
    pub supported: bool,
    /// True when a free form in its place predicts some left-out data better.
    pub contradicted: bool,
    /// True when its type is the only one and it is supported: it keeps its name also where another part of the gap has
    /// none.
    pub certain: bool,
}

/// A verdict with its reasons.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The word.
    pub word: VerdictKind,
    /// The effects that explain most of the gap, whether or not they are named.
    pub effects: Vec<MissingEffect>,
    /// The share of the excess misfit that they close, in the replicates they were fitted to.
    pub closed: f64,
    /// The probability that what is missing is of no type that is named: the remaining probability of the effect of
    /// least; `None` without effects.
    #[serde(default)]
    pub none_of_these: Option<f64>,
    /// The reasons, in words.
    pub reasons: Vec<String>,
}

/// The verdict on the result of a search.
pub fn verdict(
    found: &SearchResult<'_>,
    candidates: &[Candidate],
    options: SearchOptions,
) -> Verdict {
    let mut effects = named(found, candidates);
    let untried = with_untried(found, candidates, &mut effects);
    let grounds = Grounds::of(found, options, &effects);
    let (word, mut reasons) = if effects.is_empty() {
        without_effects(found, options, &grounds)
    } else {
        with_effects(found, candidates, &grounds, &mut effects)
    };
    if grounds.disagree && !grounds.gap {
        reasons.push(
            "a region still disagrees with the effects, though the energy of the residual is that of noise"
                .into(),
        );
    }
    reasons.extend(untried);
    reasons.extend(grounds::left_out(&found.uncertain));
    if word == VerdictKind::Unlisted {
        reasons.push(
            "the calibrated parameters make up for what has no name: they may be farther from the truth than their standard deviations say"
                .into(),
        );
    }
    reasons.extend(found.noise.provenance(found.system.experiment));
    let none_of_these = none_of_these(&effects);
    Verdict { word, effects, closed: grounds.closed, none_of_these, reasons }
}

/// The probability that what is missing is of no type that is named.
fn none_of_these(effects: &[MissingEffect]) -> Option<f64> {
    let each = effects.iter().map(|e| e.traits.map_or(e.probability, |t| t.probability()));
    each.reduce(f64::min).map(|least| 1.0 - least)
}

fn without_effects(
    found: &SearchResult<'_>,
    options: SearchOptions,
    grounds: &Grounds,
) -> (VerdictKind, Vec<String>) {
    let first = found.first();
    if grounds.gap {
        let reason =
            "data and model disagree, and the posterior odds of every candidate are against it";
        return (VerdictKind::Unlisted, vec![reason.to_owned()]);
    }
    if !first.visible.is_empty() && first.visible.iter().all(|v| v.absorbed > INVISIBLE) {
        let reason = format!(
            "the calibrated parameters absorb more than {:.0} % of every candidate",
            100.0 * INVISIBLE
        );
        return (VerdictKind::NotVisible, vec![reason]);
    }
    let p = found.last.p[0];
    let sign = if is_at_floor(p, options.simulations) { "<=" } else { "=" };
    let reason = (p <= options.naming).then(|| {
        format!(
            "the score of a candidate is significant (p {sign} {p:.3}), but the posterior odds favour no effect"
        )
    });
    (VerdictKind::None, reason.into_iter().collect())
}

fn with_effects(
    found: &SearchResult<'_>,
    candidates: &[Candidate],
    grounds: &Grounds,
    effects: &mut [MissingEffect],
) -> (VerdictKind, Vec<String>) {
    let mut reasons = grounds.doubts.clone();
    // Several effects are flexible enough to describe another form without a visible rest: each has to be supported.
    reasons.extend(grounds::unproven(effects).filter(|_| effects.len() > 1));
    reasons.extend(grounds::unforetold(found, effects));
    reasons.extend(grounds::improbable(effects));
    let sure = effects.iter().all(|e| e.class.len() == 1) && found.stability >= STABLE;
    if !reasons.is_empty() {
        return (VerdictKind::Unlisted, reasons);
    }
    let left = format!(
        "the effects close {:.0} % of the gap; the tests still see what remains, log Bayes factor {:.0}",
        100.0 * grounds.closed,
        found.last.tolerant.inexact
    );
    let free = grounds::unproven(effects);
    let is_alone = effects.iter().all(|effect| is_alone(candidates, effect));
    let is_like = grounds.closed >= MOST && is_alone && found.stability >= STABLE && free.is_none();
    let inexact = found.last.tolerant.inexact > SIGNIFICANT;
    if inexact || grounds.gap && grounds.closed < NEARLY {
        reasons.push(left);
        reasons.extend(free);
        return (inexact_word(grounds, found, effects, is_like), reasons);
    }
    if grounds.gap {
        reasons.push(left);
    }
    if found.consistency < INCONSISTENT {
        // That effects which explain the misfit differ between conditions shows that their form is not exact.
        let differ =
            "the effects that explain most differ between conditions or between their sensors";
        reasons.push(differ.to_owned());
        if is_like {
            return (VerdictKind::Approximate, reasons);
        }
        let kind = grounds.explained && widened(effects, &found.types);
        return (if kind { VerdictKind::Class } else { VerdictKind::Unlisted }, reasons);
    }
    (if sure { VerdictKind::Named } else { VerdictKind::Class }, reasons)
}

/// The verdict on effects that leave a significant remainder.
fn inexact_word(
    grounds: &Grounds,
    found: &SearchResult<'_>,
    effects: &[MissingEffect],
    is_like: bool,
) -> VerdictKind {
    if is_like {
        return VerdictKind::Approximate;
    }
    let most = effects.iter().map(|effect| effect.class.len()).max().unwrap_or(0);
    let proven = grounds::unproven(effects).is_none();
    // Which of a few types it is, the remainder hides; that it is one of them is as sure as an approximate name.
    let is_one = (2..=FEW).contains(&most) && proven;
    if is_one && grounds.closed >= MOST && found.stability >= STABLE {
        VerdictKind::Class
    } else {
        VerdictKind::Unlisted
    }
}

/// True if all other types of the class of an effect contain its type as a special case: what is missing acts like it then,
/// whichever of them it is.
fn is_alone(candidates: &[Candidate], effect: &MissingEffect) -> bool {
    let contains = |other: &String| {
        candidates.iter().any(|own| own.kind == *other && own.contains.contains(&&*effect.kind))
    };
    effect.class[1..].iter().all(contains)
}

fn named(found: &SearchResult<'_>, candidates: &[Candidate]) -> Vec<MissingEffect> {
    let sd = found.last.fit.sd();
    let mut begin = found.system.experiment.parameters.len();
    let mut all = Vec::new();
    let effects = found.system.effects.iter().zip(&found.chosen).zip(&found.types);
    for (((effect, placement), types), support) in effects.zip(&found.support) {
        let end = begin + effect.absent().len();
        let kind = &candidates[placement.candidate].kind;
        let own = types.iter().find(|(name, _)| name == kind).map_or(0.0, |(_, p)| *p);
        let alike = alike(found, candidates, all.len());
        let shares = if alike.is_empty() { types } else { &alike };
        let share = shares.iter().find(|(name, _)| name == kind).map_or(0.0, |(_, p)| *p);
        let class = class(kind, share, shares);
        let supported = support.local >= HALF && support.is_proven();
        let traits = Traits::of(found, support, &class, types);
        all.push(MissingEffect {
            name: effect.name.clone(),
            kind: kind.clone(),
            on: placement.on.clone(),
            values: found.last.fit.at.point[begin..end].to_vec(),
            sd: widened_size(effect, &found.last.fit.at.point[begin..end], &sd[begin..end]),
            probability: traits.of_type(share, &class, shares),
            posterior_probability: own,
            traits: Some(traits),
            share: support.share,
            supported,
            contradicted: support.is_contradicted(CONTRADICTED),
            certain: class.len() == 1 && supported && support.is_better(CERTAIN),
            class,
        });
        begin = end;
    }
    all
}

/// The standard deviations of the unknowns of an effect, with the error of its size that its approximations cause.
fn widened_size(effect: &Placed<'_>, values: &[f64], sd: &[f64]) -> Vec<f64> {
    let mut sd = sd.to_vec();
    let size = values[0] - effect.absent()[0];
    sd[0] = sd[0].hypot(effect.effect.relative_error() * size);
    sd
}

/// Adds to the class of each effect the effects that it looks like and that are no candidates, and says so.
fn with_untried(
    found: &SearchResult<'_>,
    candidates: &[Candidate],
    effects: &mut [MissingEffect],
) -> Vec<String> {
    let mut reasons = Vec::new();
    for (effect, placement) in effects.iter_mut().zip(&found.chosen) {
        let alike = candidates[placement.candidate].effect.looks_like();
        let untried = alike.iter().filter(|kind| !candidates.iter().any(|c| c.kind == **kind));
        for kind in untried {
            effect.class.push((*kind).to_owned());
            effect.certain = false;
            reasons.push(format!(
                "`{}` looks like `{kind}`, which was not tried: the `positions` of the sensors on their axis in `[response]` would tell",
                effect.kind
            ));
        }
    }
    reasons
}
