//! Counts over all cases of a coverage study.

use serde::{Deserialize, Serialize};

use super::binomial::{band, interval, two_sided};
use super::verdict::{ALPHA, Verdict};
use super::{Case, Coordinate, Ended, Judged, LEVELS, RANKS, ranks};
use crate::math::moments::{mean, quantile, sorted, variance};

/// Counts over all cases.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    /// Number of truths drawn.
    pub truths: usize,
    /// Number of truths whose calibration gave a posterior.
    pub calibrated: usize,
    /// Number of calibrations whose sampler converged.
    pub converged: usize,
    /// Reasons of calibrations that stopped, with the number of each.
    pub failed: Vec<(String, usize)>,
    /// Reasons why truths have no data, with the number of each.
    pub without_data: Vec<(String, usize)>,
    /// Counts of each unknown.
    pub rows: Vec<Row>,
    /// Counts of all unknowns whose truths were drawn from their priors; `None` without cases.
    pub overall: Option<Row>,
    /// Like `overall`, over the cases that converged; `None` if all did.
    pub overall_converged: Option<Row>,
    /// Verdict on the intervals.
    pub verdict: Verdict,
}

/// Counts of one unknown, or of all together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Name of the unknown.
    pub name: String,
    /// Unit of the unknown; empty for all together.
    pub unit: String,
    /// True if the truths were drawn from the prior.
    pub of_prior: bool,
    /// Coverage of the intervals of [`LEVELS`].
    pub levels: Vec<Rate>,
    /// Coverage for truths near an edge of the prior.
    pub edge: Vec<Rate>,
    /// Coverage for all other truths.
    pub centre: Vec<Rate>,
    /// Ranks of the truths as fractions, (rank + 1) / (draws + 1).
    pub ranks: Vec<f64>,
    /// True if the ranks stay inside the 99 % band of a uniform sample; `None` for all together.
    pub uniform: Option<bool>,
    /// True if the ranks stay inside the band that is corrected for the number of unknowns.
    pub uniform_jointly: Option<bool>,
    /// Ratio of posterior to prior standard deviation: 5 % quantile, median, 95 % quantile over the cases.
    pub shrinkage: [f64; 3],
    /// Mean, standard deviation and largest magnitude of (posterior mean - truth) / posterior sd.
    pub z: [f64; 3],
    /// Number of cases with fewer effective draws than a rank needs.
    pub correlated: usize,
}

/// Coverage of one interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    /// Nominal probability of the interval.
    pub nominal: f64,
    /// Expected fraction for a correct posterior: `nominal`, except for the counts at the edges and in the centre.
    pub expected: f64,
    /// Number of truths inside the interval.
    pub inside: usize,
    /// Number of truths counted.
    pub of: usize,
    /// Fraction of truths inside the interval.
    pub share: f64,
    /// 95 % confidence interval of the coverage (Clopper and Pearson).
    pub interval: [f64; 2],
    /// Band of fractions that 99 % of such counts fall into if the coverage is as expected.
    pub band: [f64; 2],
    /// Two-sided p-value: probability of a count at least as far from the expected one.
    pub p_value: f64,
    /// Position of the fraction relative to the band.
    pub side: Side,
}

/// Position of a fraction relative to its band.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Below the band: the interval is too narrow or misplaced.
    Below,
    /// Inside the band.
    Within,
    /// Above the band: the interval is too wide.
    Above,
}

/// Counts the outcomes of all cases.
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

/// Reasons, the most frequent first, with the number of each.
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

/// Counts of all unknowns whose truths were drawn from their priors. The unknowns of one case depend on each other: the
/// effective number of pairs follows from the scatter between cases (Kish's design effect) and never exceeds their
/// number.
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

/// A rank as the fraction of ranks up to and including it.
fn share_of(rank: usize) -> f64 {
    (rank + 1) as f64 / (RANKS + 1) as f64
}

/// Points at which the ranks of this number of cases are compared: all are possible ranks, and there are no more than
/// cases.
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

/// Coverage from independent truths.
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

/// Coverage from truths that are inside with different probabilities.
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

/// Coverage from truths of which each case contributes several; `cases` holds the fraction inside in each case.
fn clustered(nominal: f64, inside: usize, of: usize, cases: &[f64], size: usize) -> Rate {
    let share = inside as f64 / of as f64;
    let simple = share * (1.0 - share) / size as f64;
    // Design effect: variance between cases relative to that of independent unknowns. If all intervals contain the
    // truth, or none does, there is no variance to compare and the unknowns of a case are counted as one.
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
