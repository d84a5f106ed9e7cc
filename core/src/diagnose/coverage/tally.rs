//! What many cases say together.

use serde::{Deserialize, Serialize};

use super::binomial::{band, interval, two_sided};
use super::ranks;
use super::verdict::{ALPHA, Verdict};
use super::{Case, Coordinate, Ended, Judged, LEVELS, RANKS};
use crate::math::moments::{mean, quantile, sorted, variance};

/// What was counted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    /// The truths that were drawn.
    pub truths: usize,
    /// Those with a posterior.
    pub calibrated: usize,
    /// Those whose sampler converged.
    pub converged: usize,
    /// Calibrations that stopped: the reasons, with the number of each.
    pub failed: Vec<(String, usize)>,
    /// Truths without data: the reasons, with the number of each.
    pub without_data: Vec<(String, usize)>,
    /// Each unknown.
    pub rows: Vec<Row>,
    /// All unknowns whose truths were drawn from their priors; `None` where there is no case.
    pub overall: Option<Row>,
    /// The same over the cases that converged, where not all did.
    pub overall_converged: Option<Row>,
    /// In words.
    pub verdict: Verdict,
}

/// What was counted of one unknown, or of all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Its name.
    pub name: String,
    /// Its unit; empty for all together.
    pub unit: String,
    /// Whether its truths were drawn from its prior.
    pub of_prior: bool,
    /// The coverage of the intervals of [`LEVELS`].
    pub levels: Vec<Rate>,
    /// The same for truths near an edge of the prior.
    pub edge: Vec<Rate>,
    /// The same for the other truths.
    pub centre: Vec<Rate>,
    /// The ranks of the truths, each as a share: (rank + 1) / (draws + 1).
    pub ranks: Vec<f64>,
    /// Whether the ranks stay inside the band of a uniform sample (99 %); `None` for all together.
    pub uniform: Option<bool>,
    /// The same in the band that allows for all unknowns at once.
    pub uniform_jointly: Option<bool>,
    /// The posterior standard deviation over the prior's: 5 % quantile, median, 95 % quantile over the cases.
    pub shrinkage: [f64; 3],
    /// The mean of (posterior mean - truth) / posterior sd, its standard deviation, and its largest size.
    pub z: [f64; 3],
    /// In how many cases the draws are worth fewer independent ones than a rank needs.
    pub correlated: usize,
}

/// How often an interval held the truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    /// What it says.
    pub nominal: f64,
    /// What is expected of a right posterior: `nominal`, but at an edge and in the centre.
    pub expected: f64,
    /// How many truths it held.
    pub inside: usize,
    /// Of how many.
    pub of: usize,
    /// The share.
    pub share: f64,
    /// The 95 % interval of its probability (Clopper and Pearson).
    pub interval: [f64; 2],
    /// The shares that chance allows in 99 % of such counts.
    pub band: [f64; 2],
    /// The probability of a count so far from the expected one, on either side.
    pub p_value: f64,
    /// Whether the share is inside the band.
    pub side: Side,
}

/// Where a share lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Below the band: the interval is too narrow, or in the wrong place.
    Below,
    /// In the band.
    Within,
    /// Above it: the interval is wider than it says.
    Above,
}

/// Counts over cases.
pub fn tally(coordinates: &[Coordinate], cases: &[Case]) -> Tally {
    let all: Vec<&super::Calibration> = cases
        .iter()
        .filter_map(|case| match &case.ended {
            Ended::Calibrated(calibration) => Some(calibration),
            _ => None,
        })
        .collect();
    let good: Vec<&super::Calibration> = all.iter().copied().filter(|c| c.converged).collect();
    let joint = coordinates.iter().filter(|c| c.of_prior).count().max(1);
    let bands = [ALPHA, ALPHA / joint as f64]
        .map(|alpha| ranks::band(all.len(), &rank_points(all.len()), 1.0 - alpha));
    let rows: Vec<Row> = (0..coordinates.len())
        .map(|j| row(&coordinates[j], &unknown(&all, j), Some(&bands)))
        .collect();
    let overall = (!all.is_empty()).then(|| overall(coordinates, &all)).flatten();
    let overall_converged = (good.len() < all.len() && !good.is_empty())
        .then(|| self::overall(coordinates, &good))
        .flatten();
    let failed = reasons(cases, |ended| match ended {
        Ended::Failed(reason) => Some(reason),
        _ => None,
    });
    let without_data = reasons(cases, |ended| match ended {
        Ended::NoData(reason) => Some(reason),
        _ => None,
    });
    let (calibrated, converged) = (all.len(), good.len());
    let verdict =
        Verdict::of(&rows, overall.as_ref(), calibrated, failed.iter().map(|f| f.1).sum());
    Tally {
        truths: cases.len(),
        calibrated,
        converged,
        failed,
        without_data,
        rows,
        overall,
        overall_converged,
        verdict,
    }
}

fn unknown<'a>(all: &[&'a super::Calibration], j: usize) -> Vec<&'a Judged> {
    all.iter().map(|calibration| &calibration.unknowns[j]).collect()
}

/// The reasons, the most frequent first, with the number of each.
fn reasons(cases: &[Case], of: impl Fn(&Ended) -> Option<&String>) -> Vec<(String, usize)> {
    let mut counts: std::collections::BTreeMap<&String, usize> = std::collections::BTreeMap::new();
    cases
        .iter()
        .filter_map(|case| of(&case.ended))
        .for_each(|r| *counts.entry(r).or_default() += 1);
    let mut all: Vec<(String, usize)> = counts.into_iter().map(|(r, n)| (r.clone(), n)).collect();
    all.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
    all
}

fn row(coordinate: &Coordinate, judged: &[&Judged], bands: Option<&[ranks::Band; 2]>) -> Row {
    let ranks: Vec<f64> = judged.iter().map(|j| share_of(j.rank)).collect();
    let scale = coordinate.scale();
    let shrinkage = sorted(&judged.iter().map(|j| j.sd / scale).collect::<Vec<_>>());
    let of = |part: Option<bool>, k: usize| {
        let chosen = judged.iter().filter(|j| part.is_none_or(|e| e == j.is_at_edge(coordinate)));
        let chosen: Vec<&Judged> = chosen.copied().collect();
        let inside = chosen.iter().filter(|j| j.holds()[k]).count();
        match part {
            None => rate(LEVELS[k], inside, chosen.len()),
            Some(at_edge) => {
                let expected = chosen.iter().map(|j| j.expected(k, at_edge).unwrap_or(LEVELS[k]));
                unlike(LEVELS[k], inside, &expected.collect::<Vec<_>>())
            }
        }
    };
    let levels = |part: Option<bool>| (0..LEVELS.len()).map(|k| of(part, k)).collect();
    let uniform = |i: usize| {
        let bands = bands.filter(|_| coordinate.of_prior && !ranks.is_empty())?;
        Some(bands[i].left_at(&ranks).is_empty())
    };
    Row {
        name: coordinate.name.clone(),
        unit: coordinate.unit.to_string(),
        of_prior: coordinate.of_prior,
        levels: levels(None),
        edge: levels(Some(true)),
        centre: levels(Some(false)),
        uniform: uniform(0),
        uniform_jointly: uniform(1),
        ranks,
        shrinkage: spread(&shrinkage),
        z: z(judged),
        correlated: judged.iter().filter(|j| j.size.is_nan() || j.size < RANKS as f64).count(),
    }
}

/// All unknowns whose truths are of their priors. Those of one case depend on each other: the pairs count as
/// so many independent ones as the scatter between cases says (Kish's design effect), never as more than there are.
fn overall(coordinates: &[Coordinate], all: &[&super::Calibration]) -> Option<Row> {
    let counted: Vec<usize> = (0..coordinates.len()).filter(|&j| coordinates[j].of_prior).collect();
    if counted.is_empty() {
        return None;
    }
    let rows: Vec<Row> =
        counted.iter().map(|&j| row(&coordinates[j], &unknown(all, j), None)).collect();
    let per_case = |k: usize| -> Vec<f64> {
        let share = |c: &&super::Calibration| {
            counted.iter().filter(|&&j| c.unknowns[j].holds()[k]).count() as f64
                / counted.len() as f64
        };
        all.iter().map(share).collect()
    };
    let levels = (0..LEVELS.len()).map(|k| {
        let pairs = all.len() * counted.len();
        let inside = rows.iter().map(|row| row.levels[k].inside).sum();
        clustered(LEVELS[k], inside, pairs, &per_case(k), counted.len())
    });
    let pooled = |part: fn(&Row) -> &Vec<Rate>| -> Vec<Rate> {
        let of = |k: usize| {
            let own: Vec<&Rate> = rows.iter().map(|row| &part(row)[k]).collect();
            let (inside, of) = own.iter().fold((0, 0), |a, r| (a.0 + r.inside, a.1 + r.of));
            let expected: f64 = own.iter().map(|r| r.expected * r.of as f64).sum();
            let expected = if of > 0 { expected / of as f64 } else { LEVELS[k] };
            Rate { nominal: LEVELS[k], ..rate(expected, inside, of) }
        };
        (0..LEVELS.len()).map(of).collect()
    };
    let judged: Vec<&Judged> = counted.iter().flat_map(|&j| unknown(all, j)).collect();
    let shrinkage = counted.iter().flat_map(|&j| {
        let scale = coordinates[j].scale();
        unknown(all, j).into_iter().map(move |judged| judged.sd / scale)
    });
    Some(Row {
        name: "all".to_owned(),
        unit: String::new(),
        of_prior: true,
        levels: levels.collect(),
        edge: pooled(|row| &row.edge),
        centre: pooled(|row| &row.centre),
        ranks: Vec::new(),
        uniform: None,
        uniform_jointly: None,
        shrinkage: spread(&sorted(&shrinkage.collect::<Vec<_>>())),
        z: z(&judged),
        correlated: judged.iter().filter(|j| j.size.is_nan() || j.size < RANKS as f64).count(),
    })
}

/// A rank as the share of ranks up to it.
fn share_of(rank: usize) -> f64 {
    (rank + 1) as f64 / (RANKS + 1) as f64
}

/// Where the ranks of so many cases are compared: no more points than there are cases, all of them ranks.
pub fn rank_points(cases: usize) -> Vec<f64> {
    let step = [1, 2, 4, 5, 10].into_iter().find(|s| (RANKS + 1) / s <= cases.max(10));
    let step = step.unwrap_or(10);
    (step..=RANKS).step_by(step).map(|i| i as f64 / (RANKS + 1) as f64).collect()
}

fn spread(ordered: &[f64]) -> [f64; 3] {
    if ordered.is_empty() { [f64::NAN; 3] } else { [0.05, 0.5, 0.95].map(|p| quantile(ordered, p)) }
}

fn z(judged: &[&Judged]) -> [f64; 3] {
    let all: Vec<f64> = judged.iter().map(|j| j.z()).collect();
    if all.is_empty() {
        return [f64::NAN; 3];
    }
    [mean(&all), variance(&all).sqrt(), all.iter().fold(0.0, |a: f64, z| a.max(z.abs()))]
}

/// A count of independent truths.
fn rate(nominal: f64, inside: usize, of: usize) -> Rate {
    let [low, high] = band(of, nominal, 0.5 * ALPHA);
    let counts = [low as f64, high as f64];
    let p_value = if of > 0 { two_sided(inside, &vec![nominal; of]) } else { 1.0 };
    filled(
        nominal,
        nominal,
        inside,
        of,
        of as f64,
        counts.map(|k| k / (of as f64).max(1.0)),
        p_value,
    )
}

/// A count of truths that are held with unlike probabilities.
fn unlike(nominal: f64, inside: usize, expected: &[f64]) -> Rate {
    let of = expected.len();
    if of == 0 {
        return rate(nominal, 0, 0);
    }
    let law = super::binomial::of_unlike(expected);
    let upto = |tail: f64, law: &mut dyn Iterator<Item = &f64>| {
        let mut sum = 0.0;
        let beyond = law.take_while(|&&term| {
            sum += term;
            sum <= tail
        });
        beyond.count()
    };
    let low = upto(0.5 * ALPHA, &mut law.iter());
    let high = of - upto(0.5 * ALPHA, &mut law.iter().rev());
    let shares = [low, high].map(|k| k as f64 / of as f64);
    filled(nominal, mean(expected), inside, of, of as f64, shares, two_sided(inside, expected))
}

/// A count of truths, some of each case, whose shares in the cases are given.
fn clustered(nominal: f64, inside: usize, of: usize, cases: &[f64], size: usize) -> Rate {
    let share = inside as f64 / of as f64;
    let simple = share * (1.0 - share) / size as f64;
    let effect =
        if simple > 0.0 && cases.len() > 1 { variance(cases) / simple } else { size as f64 };
    let worth = (of as f64 / effect.clamp(1.0, size as f64)).round().max(1.0);
    let whole = worth as usize;
    let [low, high] = band(whole, nominal, 0.5 * ALPHA);
    let count = (share * worth).round() as usize;
    let p_value = two_sided(count.min(whole), &vec![nominal; whole]);
    filled(nominal, nominal, inside, of, worth, [low, high].map(|k| k as f64 / worth), p_value)
}

fn filled(
    nominal: f64,
    expected: f64,
    inside: usize,
    of: usize,
    worth: f64,
    band: [f64; 2],
    p_value: f64,
) -> Rate {
    let share = if of > 0 { inside as f64 / of as f64 } else { f64::NAN };
    let slack = 1e-12;
    let side = match () {
        () if of > 0 && share < band[0] - slack => Side::Below,
        () if of > 0 && share > band[1] + slack => Side::Above,
        () => Side::Within,
    };
    let counted = if of > 0 { share * worth } else { 0.0 };
    let interval = interval(counted, if of > 0 { worth } else { 0.0 }, 0.95);
    Rate { nominal, expected, inside, of, share, interval, band, p_value, side }
}

#[cfg(test)]
mod tests;
