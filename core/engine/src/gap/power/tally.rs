//! The rates over many cases.

use std::collections::BTreeMap;

use lacuna::diagnose::coverage::binomial;
use serde::{Deserialize, Serialize};

use super::open_world::{OutsideRates, outside, told};
use super::{ABSORBED, CaseOutcome};
use crate::gap::search::{Reliability, Told, Traits, VerdictKind};

/// The share of cases at which a size counts as *found*.
const FOUND: f64 = 0.8;

/// Detection rates of the workflow in a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rates {
    /// The hash of the inputs of the search that was run on the cases.
    #[serde(default)]
    pub search: String,
    /// False alarms in cases without an injection.
    pub alarms: Alarm,
    /// Each type of effect.
    pub kinds: Vec<KindRates>,
    /// The number of times that an injected type (first) was named another (second): single effects with the verdict
    /// `named`.
    pub confusion: Vec<(String, String, usize)>,
    /// Names that were given, and how many of them were right, over all single effects.
    pub named: [usize; 2],
    /// Pairs: number of cases, and of cases in which both effects were named or in their classes.
    pub pairs: [usize; 2],
    /// Changes of another form than those of the candidates, by kind.
    pub outside: Vec<OutsideRates>,
    /// Bumps by size: ratio, cases, cases that were found, mean overlap of the regions.
    pub bumps: Vec<(f64, usize, usize, f64)>,
    /// The probabilities that `gap` prints, by its own default, beside the share that was right: effects and pairs of the
    /// library have half of the weight, changes of another form the other half.
    pub reliability: Reliability,
    /// The same for the posterior probabilities, which assume that one of the candidates is exactly true.
    pub of_posterior: Reliability,
}

/// False alarms with their 95 % interval (Clopper and Pearson, Biometrika 26 (1934) 404).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Alarm {
    /// The cases.
    pub cases: usize,
    /// The alarms.
    pub alarms: usize,
    /// The interval of their probability.
    pub interval: [f64; 2],
}

/// Detection rates of a type of effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KindRates {
    /// The type of effect.
    pub kind: String,
    /// The rates by size, the smallest first.
    pub sizes: Vec<SizeRates>,
    /// The smallest size, as a ratio to the noise, from which on effects were found in 80 % of the cases that the
    /// parameters do not absorb; `None` if no size was large enough.
    pub smallest: Option<f64>,
}

/// Detection rates of a type at one size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SizeRates {
    /// The size as a ratio to the noise.
    pub ratio: f64,
    /// The number of cases.
    pub cases: usize,
    /// The number of cases that the calibrated parameters absorb.
    pub absorbed: usize,
    /// The number of cases with any alarm.
    pub detected: usize,
    /// The number of cases with the type in the class.
    pub in_class: usize,
    /// The number of cases with the type named alone.
    pub named: usize,
    /// The median of the sizes in the effect's own unit: the absolute distance from its absent value.
    pub size: f64,
}

/// The rates of outcomes.
pub fn rates(outcomes: &[CaseOutcome]) -> Rates {
    let of = |what: &'static str| outcomes.iter().filter(move |o| o.planted.what == what);
    let alarm = |o: &&CaseOutcome| !matches!(o.word, VerdictKind::None | VerdictKind::NotVisible);
    let (nothing, alarms) = (of("nothing").count(), of("nothing").filter(alarm).count());
    let single: Vec<&CaseOutcome> = outcomes
        .iter()
        .filter(|o| o.planted.effects.len() == 1 && o.planted.bump.is_none())
        .collect();
    let pairs: Vec<&CaseOutcome> =
        outcomes.iter().filter(|o| o.planted.effects.len() == 2).collect();
    let both = |o: &&&CaseOutcome| o.planted.effects.iter().all(|(kind, ..)| in_class(o, kind));
    let sure = |o: &&&CaseOutcome| o.word == VerdictKind::Named;
    let right = |o: &&&CaseOutcome| o.effects.iter().all(|said| said.kind == o.planted.what);
    let reliability = |by: &dyn Fn(&Traits) -> f64| -> Reliability {
        let all: Vec<Told> = told(outcomes, by);
        Reliability::of(&all)
    };
    Rates {
        search: String::new(),
        alarms: Alarm { cases: nothing, alarms, interval: interval(alarms, nothing) },
        kinds: kinds(&single),
        confusion: confusion(&single),
        named: [
            single.iter().filter(sure).count(),
            single.iter().filter(sure).filter(right).count(),
        ],
        pairs: [pairs.len(), pairs.iter().filter(both).count()],
        outside: outside(outcomes),
        bumps: bumps(&of("bump").collect::<Vec<_>>()),
        reliability: reliability(&Traits::probability),
        of_posterior: reliability(&Traits::posterior),
    }
}

fn in_class(outcome: &CaseOutcome, kind: &str) -> bool {
    outcome.word != VerdictKind::None
        && outcome.effects.iter().any(|said| said.class.iter().any(|other| other == kind))
}

fn kinds(single: &[&CaseOutcome]) -> Vec<KindRates> {
    let mut by_kind: BTreeMap<&str, BTreeMap<u64, Vec<&CaseOutcome>>> = BTreeMap::new();
    for &outcome in single {
        let sizes = by_kind.entry(&outcome.planted.what).or_default();
        // Ratios are not negative, so that the order of their bits is the order of their values.
        sizes.entry(outcome.planted.ratio.to_bits()).or_default().push(outcome);
    }
    let of_kind = |(kind, sizes): (&str, BTreeMap<u64, Vec<&CaseOutcome>>)| {
        let sizes: Vec<(SizeRates, Vec<&CaseOutcome>)> =
            sizes.into_values().map(|own| (of_size(kind, &own), own)).collect();
        let smallest = smallest(kind, &sizes);
        let sizes = sizes.into_iter().map(|(rates, _)| rates).collect();
        KindRates { kind: kind.to_owned(), sizes, smallest }
    };
    by_kind.into_iter().map(of_kind).collect()
}

fn is_absorbed(outcome: &CaseOutcome) -> bool {
    outcome.absorbed > ABSORBED
}

/// The smallest size from which on all effects that are not absorbed are found.
fn smallest(kind: &str, sizes: &[(SizeRates, Vec<&CaseOutcome>)]) -> Option<f64> {
    let mut smallest = None;
    for (rates, own) in sizes.iter().rev() {
        let seen: Vec<&&CaseOutcome> = own.iter().filter(|o| !is_absorbed(o)).collect();
        let found = seen.iter().filter(|o| in_class(o, kind)).count();
        if seen.is_empty() {
            continue;
        }
        if (found as f64) < FOUND * seen.len() as f64 {
            break;
        }
        smallest = Some(rates.ratio);
    }
    smallest
}

fn of_size(kind: &str, own: &[&CaseOutcome]) -> SizeRates {
    let count = |test: &dyn Fn(&CaseOutcome) -> bool| own.iter().filter(|o| test(o)).count();
    let mut sizes: Vec<f64> = own.iter().map(|o| o.planted.sizes[0]).collect();
    sizes.sort_by(f64::total_cmp);
    SizeRates {
        ratio: own[0].planted.ratio,
        cases: own.len(),
        absorbed: count(&is_absorbed),
        detected: count(&|o| !matches!(o.word, VerdictKind::None | VerdictKind::NotVisible)),
        in_class: count(&|o| in_class(o, kind)),
        named: count(&|o| {
            o.word == VerdictKind::Named && o.effects.iter().all(|said| said.kind == kind)
        }),
        size: sizes[sizes.len() / 2],
    }
}

fn confusion(single: &[&CaseOutcome]) -> Vec<(String, String, usize)> {
    let mut counts: BTreeMap<(String, String), usize> = BTreeMap::new();
    for outcome in single.iter().filter(|o| o.word == VerdictKind::Named) {
        for said in &outcome.effects {
            *counts.entry((outcome.planted.what.clone(), said.kind.clone())).or_default() += 1;
        }
    }
    counts.into_iter().map(|((planted, named), n)| (planted, named, n)).collect()
}

fn bumps(all: &[&CaseOutcome]) -> Vec<(f64, usize, usize, f64)> {
    let mut by_size: BTreeMap<u64, Vec<&CaseOutcome>> = BTreeMap::new();
    for &outcome in all {
        by_size.entry(outcome.planted.ratio.to_bits()).or_default().push(outcome);
    }
    let of_size = |own: Vec<&CaseOutcome>| {
        let found = own.iter().filter(|o| o.word != VerdictKind::None).count();
        let overlaps: f64 = own.iter().filter_map(|o| o.overlap).sum();
        (own[0].planted.ratio, own.len(), found, overlaps / own.len() as f64)
    };
    by_size.into_values().map(of_size).collect()
}

/// The 95 % interval of a probability from `k` of `n`.
fn interval(k: usize, n: usize) -> [f64; 2] {
    binomial::interval(k as f64, n as f64, 0.95)
}

#[cfg(test)]
mod tests {
    use super::super::{Injected, NamedInCase};
    use super::*;
    use lacuna::plugin::effect::On;

    /// 9 of 200: 2.1 to 8.4 % (as an exact binomial test gives in R's `binom.test(9, 200)`: 0.02078, 0.08370).
    #[test]
    fn the_interval_is_that_of_clopper_and_pearson() {
        let [low, high] = interval(9, 200);
        assert!((low - 0.020_78).abs() < 5e-5 && (high - 0.083_70).abs() < 5e-5, "{low} {high}");
    }

    /// Absorbed effects count for no size, and a size counts only if no larger one is missed.
    #[test]
    fn what_is_absorbed_says_nothing_of_the_smallest_size() {
        let outcome = |ratio: f64, absorbed: f64, found: bool| CaseOutcome {
            case: 0,
            planted: Injected {
                what: "gain".into(),
                effects: vec![("gain".into(), On::new(), vec![1.05])],
                sizes: vec![0.05],
                ratio,
                bump: None,
                outside: None,
            },
            word: if found { VerdictKind::Named } else { VerdictKind::None },
            effects: found
                .then(|| NamedInCase {
                    kind: "gain".into(),
                    on: On::new(),
                    class: vec!["gain".into()],
                    traits: None,
                })
                .into_iter()
                .collect(),
            absorbed,
            overlap: None,
        };
        let smallest = |outcomes: &[CaseOutcome]| rates(outcomes).kinds[0].smallest;
        let seen = [outcome(0.5, 0.2, true), outcome(1.0, 0.2, true), outcome(1.0, 1.0, false)];
        assert_eq!(smallest(&seen), Some(0.5));
        assert_eq!(rates(&seen).kinds[0].sizes[1].absorbed, 1);
        assert_eq!(smallest(&[outcome(0.5, 0.2, true), outcome(1.0, 0.2, false)]), None);
        assert_eq!(smallest(&[outcome(1.0, 1.0, false)]), None);
        assert!((rates(&seen).kinds[0].sizes[0].size - 0.05).abs() < 1e-12);
    }
}
