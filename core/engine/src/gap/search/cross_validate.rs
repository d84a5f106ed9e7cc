//! Cross-validation: which of two explanations predicts left-out data better?
//!
//! Conditions, replicates, sensors and blocks of the last axis are left out in turn. The score is the joint log
//! predictive density of all values that are left out given all others, never that of single values, which are
//! correlated (Bürkner, Gabry and Vehtari, Computational Statistics 36 (2021) 1243). Both explanations are refitted to
//! the remaining data and integrated over the linearised posterior from these data. Correlated noise between the
//! left-out part and the rest, and the covariance of the emulator's error, are included.

use lacuna::math::special::{normal_quantile, student_t_cdf};
use lacuna::plugin::discrepancy::CommonError;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::fold_score::{FoldScore, Whitened, score_of};
use super::folds::{Fold, folds};
use crate::gap::experiment::Experiment;
use crate::gap::noise::Noise;
use crate::gap::system::System;
use crate::gap::system::fit::Fit;

/// A log score that is strong evidence: 20 to 1 (Kass and Raftery, Journal of the American Statistical Association 90
/// (1995) 773).
pub(super) const STRONG: f64 = 3.0;

/// The number of standard errors by which an explanation has to predict left-out data better than its rival.
pub const PROVEN: f64 = 2.5;

/// The number of parts that all have to favour an explanation where their differences are not of one size: of two equal ones
/// so many parts favour the first with the probability 1/16, and by [`PROVEN`] standard errors with 0.04.
const UNANIMOUS: usize = 4;

/// A kind of part that is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LeftOut {
    /// One condition.
    Condition,
    /// One replicate of one condition.
    Replicate,
    /// One sensor under all conditions.
    Sensor,
    /// A block of the last axis under one condition, and nothing of its neighbourhood in the rest. Without replicates
    /// nothing after it is in the rest: each block is foretold.
    Block,
}

impl LeftOut {
    /// One such part, in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Condition => "condition",
            Self::Replicate => "replicate",
            Self::Sensor => "sensor",
            Self::Block => "block of the last axis",
        }
    }
}

/// An explanation with its fit to all data.
#[derive(Clone, Copy)]
pub struct Explanation<'a, 'b> {
    /// The system.
    pub system: &'b System<'a>,
    /// The best fit.
    pub fit: &'b Fit,
    /// The remainder that it leaves, as a further covariance of the mean; `None` for nothing.
    pub remainder: Option<&'b CommonError>,
}

impl<'a, 'b> Explanation<'a, 'b> {
    /// An explanation that leaves nothing.
    pub fn exact(system: &'b System<'a>, fit: &'b Fit) -> Self {
        Self { system, fit, remainder: None }
    }
}

/// The cross-validation of two explanations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CrossValidation {
    /// The kind of part that was left out.
    pub left_out: LeftOut,
    /// The number of parts, each left out once.
    pub parts: usize,
    /// The log predictive density of the first explanation minus that of the second, summed over the parts; positive
    /// values favour the first.
    pub difference: f64,
    /// The difference minus the expected advantage of the best of `tried` equal explanations.
    pub corrected: f64,
    /// The standard error of the difference; `None` if there are too few pairs.
    pub error: Option<f64>,
    /// True if the standard error is from paired replicates, false if it is from paired parts.
    pub by_replicates: bool,
    /// The standard error from the variance between the parts; `None` below three.
    pub scatter: Option<f64>,
    /// The number of parts that favour the first by more than 20 to 1.
    pub in_favour: usize,
    /// The number of parts that favour the second by more than 20 to 1.
    pub against: usize,
    /// The p-value of the advantage if all explanations that were tried were equal; `None` without a standard error.
    pub p: Option<f64>,
}

impl CrossValidation {
    /// True when the first predicts better by 2.5 standard errors; or, where the parts themselves give the error, when each
    /// of at least four favours it by more than 20 to 1. The parts of one record may show a law by amounts of several orders
    /// of magnitude, whose standard error is about their sum though none of them contradicts it.
    pub fn is_proven(&self) -> bool {
        let all_favour = self.in_favour == self.parts && self.parts >= UNANIMOUS;
        self.is_better(PROVEN) || !self.by_replicates && all_favour
    }

    /// True when the first predicts better by so many standard errors; of a negative number, not worse by as many.
    pub fn is_better(&self, errors: f64) -> bool {
        self.difference > errors * self.error.unwrap_or(0.0)
    }
}

/// Compares two explanations by cross-validation; the first is the best of `tried`.
///
/// Returns one entry per kind of part that the data allow to be left out. Each part costs two refits.
pub fn cross_validate(
    first: Explanation<'_, '_>,
    second: Explanation<'_, '_>,
    noise: &Noise,
    tried: usize,
) -> Vec<CrossValidation> {
    cross_validate_parts(first, second, noise, tried, |_| true)
}

/// As [`cross_validate`], with the parts for which `is_used` is true.
pub(super) fn cross_validate_parts(
    first: Explanation<'_, '_>,
    second: Explanation<'_, '_>,
    noise: &Noise,
    tried: usize,
    is_used: impl Fn(&Fold) -> bool,
) -> Vec<CrossValidation> {
    let experiment = first.system.experiment;
    let kinds = [LeftOut::Condition, LeftOut::Replicate, LeftOut::Sensor, LeftOut::Block];
    let compared = kinds.into_iter().filter_map(|left_out| {
        let mut folds = folds(experiment, noise, left_out);
        folds.retain(&is_used);
        if folds.len() < 2 {
            return None;
        }
        let both = [first, second];
        // Only beside a block is something hidden: otherwise a part and the rest together are all data.
        let whole = (left_out != LeftOut::Block).then(|| Whitened::of(&both, experiment, noise));
        let all: Vec<Option<FoldScore>> =
            folds.par_iter().map(|fold| score_of(&both, noise, fold, whole.as_ref())).collect();
        let all: Vec<FoldScore> = all.into_iter().flatten().collect();
        (all.len() >= 2).then(|| summary(experiment, left_out, &all, tried))
    });
    compared.collect()
}

fn summary(
    experiment: &Experiment<'_>,
    left_out: LeftOut,
    all: &[FoldScore],
    tried: usize,
) -> CrossValidation {
    let difference: f64 = all.iter().map(|told| told.difference).sum();
    let of_parts = of_parts(all);
    let found = if left_out == LeftOut::Replicate {
        of_replicates(experiment, all).map(|found| (found, true))
    } else {
        let paired = jackknife(experiment, all).map(|found| (found, true));
        paired.or_else(|| of_parts.map(|found| (found, false)))
    };
    let (mut corrected, mut p) = (difference, None);
    if let Some(((error, freedom), _)) = found {
        corrected -= error * ahead(tried);
        p = student_t_cdf(freedom, -difference / error.max(f64::MIN_POSITIVE))
            .map(|one| 1.0 - (1.0 - one).powf(tried.max(1) as f64));
    }
    CrossValidation {
        left_out,
        parts: all.len(),
        difference,
        corrected,
        error: found.map(|((error, _), _)| error),
        by_replicates: found.is_some_and(|(_, by_replicates)| by_replicates),
        scatter: of_parts.map(|(error, _)| error),
        in_favour: all.iter().filter(|told| told.difference > STRONG).count(),
        against: all.iter().filter(|told| told.difference < -STRONG).count(),
        p,
    }
}

/// The mean of the largest of so many standard normal numbers (Blom, Statistical Estimates and Transformed
/// Beta-Variables, 1958).
fn ahead(tried: usize) -> f64 {
    if tried < 2 {
        return 0.0;
    }
    let k = tried as f64;
    normal_quantile((k - 0.375) / (k + 0.25))
}

/// The error of a sum over replicates, by their scatter within conditions, and its freedom.
fn of_replicates(experiment: &Experiment<'_>, all: &[FoldScore]) -> Option<(f64, f64)> {
    let (mut variance, mut freedom) = (0.0, 0.0);
    for c in 0..experiment.conditions.len() {
        let own = all.iter().filter(|told| told.replicate == Some(c)).map(|told| told.difference);
        let own: Vec<f64> = own.collect();
        if own.len() < 2 {
            continue;
        }
        let n = own.len() as f64;
        variance += n / (n - 1.0) * squares(&own);
        freedom += n - 1.0;
    }
    (freedom > 0.0).then(|| (variance.sqrt(), freedom))
}

/// The error of the sum over the parts by leaving replicates out of what is left out (Efron and Stein, Annals of
/// Statistics 9 (1981) 586); `None` where a condition has no second replicate.
fn jackknife(experiment: &Experiment<'_>, all: &[FoldScore]) -> Option<(f64, f64)> {
    let (mut variance, mut freedom) = (0.0, 0.0);
    for c in 0..experiment.conditions.len() {
        let touching: Vec<&FoldScore> =
            all.iter().filter(|told| !told.without[c].is_empty()).collect();
        let Some(first) = touching.first() else { continue };
        let count = first.without[c].len();
        if count < 2 {
            return None;
        }
        let sum = |r: usize| touching.iter().map(|told| told.without[c][r]).sum::<f64>();
        let n = count as f64;
        variance += (n - 1.0) / n * squares(&(0..count).map(sum).collect::<Vec<_>>());
        freedom += n - 1.0;
    }
    (freedom > 0.0).then(|| (variance.sqrt(), freedom))
}

/// The error of the sum over the parts by their own scatter; three of them at least.
fn of_parts(all: &[FoldScore]) -> Option<(f64, f64)> {
    let own: Vec<f64> = all.iter().map(|told| told.difference).collect();
    let n = own.len() as f64;
    (own.len() >= 3).then(|| ((n / (n - 1.0) * squares(&own)).sqrt(), n - 1.0))
}

/// The sum of the squared differences from the mean.
fn squares(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|x| (x - mean).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use lacuna::math::random::Stream;

    use super::*;
    use crate::gap::testing::SyntheticExperiment;

    /// The comparison of parts of these differences, each favouring the first by so much also without one of its replicates.
    fn told(differences: &[f64], replicates: usize) -> CrossValidation {
        let world = SyntheticExperiment::new(&["c"], &["s"], 8, 0.0, &["level"], |_, _, _, _| 1.0);
        let experiment = world.experiment(&[0.0; 8], replicates, &Stream::root(1));
        let part = |difference: &f64| FoldScore {
            difference: *difference,
            replicate: None,
            without: vec![(0..replicates).map(|r| difference * r as f64).collect()],
        };
        let all: Vec<FoldScore> = differences.iter().map(part).collect();
        summary(&experiment, LeftOut::Block, &all, 1)
    }

    /// The standard error of a sum of which one part is nearly all is the sum, whatever the other parts say.
    #[test]
    fn parts_of_several_orders_of_magnitude_are_a_proof_if_none_is_missing() {
        let growing = told(&[12.0, 300.0, 9e3, 6e5], 1);
        assert!(!growing.is_better(PROVEN) && growing.is_proven(), "{growing:?}");
        for (case, differences) in [
            ("one against", &[-12.0, 300.0, 9e3, 6e5][..]),
            ("one undecided", &[1.0, 300.0, 9e3, 6e5]),
            ("three", &[300.0, 9e3, 6e5]),
        ] {
            assert!(!told(differences, 1).is_proven(), "{case}");
        }
        let even = told(&[12.0, 14.0, 11.0, 1.0], 1);
        assert!(even.is_better(PROVEN) && even.is_proven(), "{even:?}");
        // Replicates tell the error of the sum.
        let paired = told(&[12.0, 300.0, 9e3, 6e5], 2);
        assert!(paired.by_replicates && !paired.is_proven(), "{paired:?}");
    }
}
