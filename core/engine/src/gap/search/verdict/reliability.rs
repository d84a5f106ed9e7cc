//! Reliability: probabilities that were told, beside the share of cases that were right.

use lacuna::diagnose::coverage::binomial;
use serde::{Deserialize, Serialize};

use super::probability::{CEILING, FLOOR};

/// The ends of the bins of told probabilities.
const EDGES: [f64; 7] = [0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 1.0];

/// The weight of the default probability in each bin of a study's own count, as a number of cases: it was fitted to
/// about a hundred cases, of other systems.
const PRIOR: f64 = 20.0;

/// A told probability and its outcome.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Told {
    /// The probability.
    pub probability: f64,
    /// True if what was said is right.
    pub right: bool,
    /// The weight of the case.
    pub weight: f64,
}

/// The share of right names by told probability.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Reliability {
    /// The bins, in increasing order of the probability.
    pub bins: Vec<Bin>,
    /// The mean squared error of the probabilities and its parts; `None` without cases.
    pub brier: Option<Brier>,
}

/// A bin of told probabilities.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Bin {
    /// The lower and the upper end.
    pub between: [f64; 2],
    /// The number of cases.
    pub cases: usize,
    /// The number of those that were right.
    pub right: usize,
    /// The weighted mean of the told probabilities; the middle of the bin without cases.
    pub told: f64,
    /// The weighted share that was right.
    pub share: f64,
    /// The number of cases of equal weight whose share is as uncertain (Kish, Survey Sampling, 1965).
    pub effective: f64,
    /// The 95 % interval of the share (Clopper and Pearson, Biometrika 26 (1934) 404; for weighted cases Korn and
    /// Graubard, Survey Methodology 24 (1998) 193).
    pub interval: [f64; 2],
}

/// The Brier score, the mean squared difference of probability and outcome, and its parts: `score` is about
/// `reliability - resolution + uncertainty` (Murphy, Journal of Applied Meteorology 12 (1973) 595), exactly so if all
/// probabilities of a bin are equal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Brier {
    /// The mean squared difference; 0 is perfect.
    pub score: f64,
    /// The mean squared difference of the told probabilities and the shares that were right; 0 is perfect.
    pub reliability: f64,
    /// The variance of the shares between the bins: how well the probabilities separate right from wrong.
    pub resolution: f64,
    /// The variance of the outcomes.
    pub uncertainty: f64,
}

impl Reliability {
    /// The table of these cases.
    pub fn of(all: &[Told]) -> Self {
        let last = EDGES.len() - 2;
        let bin_of = |p: f64| EDGES[1..].iter().position(|end| p < *end).unwrap_or(last).min(last);
        let bins: Vec<Bin> = (0..=last)
            .map(|b| {
                let own: Vec<&Told> = all.iter().filter(|t| bin_of(t.probability) == b).collect();
                Bin::of([EDGES[b], EDGES[b + 1]], &own)
            })
            .collect();
        let brier = Brier::of(all, &bins);
        Self { bins, brier }
    }

    /// The number of cases.
    pub fn cases(&self) -> usize {
        self.bins.iter().map(|bin| bin.cases).sum()
    }

    /// The probability after this count, if it was `told` before: in each bin the mean of a beta distribution whose
    /// prior has the told probability as its mean and the weight of twenty cases. Neighbouring bins are counted
    /// together as long as the probability would fall from one to the next (pooled adjacent violators), so that the
    /// result never falls with `told`. It is `told` itself where nothing was counted.
    pub fn corrected(&self, told: f64) -> f64 {
        let told = told.clamp(FLOOR, CEILING);
        let pools = self.pools();
        let own = pools.iter().find(|pool| told < pool.end).or(pools.last());
        own.map_or(told, |pool| pool.at(told)).clamp(FLOOR, CEILING)
    }

    fn pools(&self) -> Vec<Pool> {
        let mut pools: Vec<Pool> = Vec::new();
        for bin in &self.bins {
            let [begin, end] = bin.between;
            let right = bin.effective * bin.share;
            let mut next = Pool { begin, end, prior: PRIOR, count: bin.effective, right };
            while let Some(before) =
                pools.pop_if(|before| before.at(before.end) > next.at(next.begin))
            {
                next = before.and(&next);
            }
            pools.push(next);
        }
        pools
    }
}

/// Neighbouring bins that are counted together.
struct Pool {
    begin: f64,
    end: f64,
    prior: f64,
    count: f64,
    right: f64,
}

impl Pool {
    fn at(&self, told: f64) -> f64 {
        (self.prior * told + self.right) / (self.prior + self.count)
    }

    fn and(&self, next: &Self) -> Self {
        Self {
            begin: self.begin,
            end: next.end,
            prior: self.prior + next.prior,
            count: self.count + next.count,
            right: self.right + next.right,
        }
    }
}

impl Bin {
    fn of(between: [f64; 2], own: &[&Told]) -> Self {
        let sum = |f: &dyn Fn(&Told) -> f64| own.iter().map(|t| t.weight * f(t)).sum::<f64>();
        let (all, squares) = (sum(&|_| 1.0), sum(&|t| t.weight));
        let right = |t: &Told| if t.right { 1.0 } else { 0.0 };
        let middle = 0.5 * (between[0] + between[1]);
        let (told, share, effective) = if all > 0.0 {
            (sum(&|t| t.probability) / all, sum(&right) / all, all * all / squares)
        } else {
            (middle, 0.0, 0.0)
        };
        Self {
            between,
            cases: own.len(),
            right: own.iter().filter(|t| t.right).count(),
            told,
            share,
            effective,
            interval: binomial::interval(effective * share, effective, 0.95),
        }
    }
}

impl Brier {
    fn of(all: &[Told], bins: &[Bin]) -> Option<Self> {
        let sum = |f: &dyn Fn(&Told) -> f64| all.iter().map(|t| t.weight * f(t)).sum::<f64>();
        let whole = sum(&|_| 1.0);
        if whole <= 0.0 {
            return None;
        }
        let right = |t: &Told| if t.right { 1.0 } else { 0.0 };
        let mean = sum(&right) / whole;
        let bin_of = |t: &Told| {
            bins.iter()
                .find(|bin| t.probability < bin.between[1])
                .or(bins.last())
                .map_or((mean, mean), |bin| (bin.told, bin.share))
        };
        Some(Self {
            score: sum(&|t| (t.probability - right(t)).powi(2)) / whole,
            reliability: sum(&|t| {
                let (told, share) = bin_of(t);
                (told - share).powi(2)
            }) / whole,
            resolution: sum(&|t| (bin_of(t).1 - mean).powi(2)) / whole,
            uncertainty: mean * (1.0 - mean),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(probability: f64, cases: usize, right: usize) -> Vec<Told> {
        (0..cases).map(|i| Told { probability, right: i < right, weight: 1.0 }).collect()
    }

    /// Two probabilities: 0.3, right in 4 of 10, and 0.85, right in 27 of 30. The parts by hand: the mean is 31/40; the score
    /// `(4 * 0.49 + 6 * 0.09 + 27 * 0.0225 + 3 * 0.7225) / 40`. The interval of 27 of 30 is R's `binom.test(27, 30)`: 0.7347,
    /// 0.9789.
    #[test]
    fn a_table_has_its_closed_form() {
        let found = Reliability::of(&[told(0.3, 10, 4), told(0.85, 30, 27)].concat());
        let full: Vec<&Bin> = found.bins.iter().filter(|bin| bin.cases > 0).collect();
        assert_eq!(full.len(), 2);
        assert_eq!((full[0].cases, full[0].right, full[1].cases, full[1].right), (10, 4, 30, 27));
        assert!((full[1].interval[0] - 0.7347).abs() < 1e-4, "{:?}", full[1]);
        assert!((full[1].interval[1] - 0.9789).abs() < 1e-4, "{:?}", full[1]);
        let brier = found.brier.unwrap();
        let mean = 31.0 / 40.0;
        let score = (4.0 * 0.49 + 6.0 * 0.09 + 27.0 * 0.0225 + 3.0 * 0.7225) / 40.0;
        let reliability = (10.0 * 0.01 + 30.0 * 0.0025) / 40.0;
        let resolution = (10.0 * f64::powi(0.4 - mean, 2) + 30.0 * f64::powi(0.9 - mean, 2)) / 40.0;
        let exact = [score, reliability, resolution, mean * (1.0 - mean)];
        let parts = [brier.score, brier.reliability, brier.resolution, brier.uncertainty];
        for (part, exact) in parts.iter().zip(exact) {
            assert!((part - exact).abs() < 1e-12, "{parts:?} {exact}");
        }
        // Each bin has probabilities of one value, so that the decomposition is exact.
        assert!((score - (reliability - resolution + mean * (1.0 - mean))).abs() < 1e-12);
    }

    /// Cases of weight 3 and 1: the share is weighted, and the effective number is `(sum w)^2 / sum w^2`.
    #[test]
    fn weights_count() {
        let right = Told { probability: 0.5, right: true, weight: 3.0 };
        let wrong = Told { right: false, weight: 1.0, ..right };
        let found = Reliability::of(&[right, right, wrong, wrong]);
        let bin = found.bins.iter().find(|bin| bin.cases > 0).unwrap();
        assert!((bin.share - 0.75).abs() < 1e-12 && (bin.effective - 64.0 / 20.0).abs() < 1e-12);
    }

    /// Nothing was counted: a probability stays. Sixty of 60 at 0.7 and none of 60 at 0.95, the other way round than they
    /// should be: the correction does not fall, and lies between the shares.
    #[test]
    fn a_correction_is_monotone_and_bounded() {
        let grid = || (0..=100).map(|i| f64::from(i) / 100.0);
        let none = Reliability::of(&[]);
        for p in grid() {
            assert!((none.corrected(p) - p.clamp(FLOOR, CEILING)).abs() < 1e-12, "{p}");
        }
        // The mean of a beta distribution: (20 * 0.85 + 45) / (20 + 50).
        let one = Reliability::of(&told(0.85, 50, 45));
        assert!((one.corrected(0.85) - 62.0 / 70.0).abs() < 1e-12);
        for cases in [
            [told(0.7, 60, 60), told(0.95, 60, 0)].concat(),
            [told(0.3, 40, 30), told(0.85, 30, 3)].concat(),
            told(0.99, 200, 200),
            told(0.1, 200, 0),
        ] {
            let found = Reliability::of(&cases);
            let mut before = 0.0;
            for p in grid() {
                let now = found.corrected(p);
                assert!(now >= before && (FLOOR..=CEILING).contains(&now), "{p}: {now}");
                before = now;
            }
        }
    }
}
