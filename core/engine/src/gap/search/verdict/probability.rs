//! The probability that a name is right: the share of right names among simulated cases like it, of which half hide
//! physics that no candidate has.
//!
//! The posterior probability of a type assumes that one of the candidates is exactly true. Where none is, it is near one
//! for the candidate that happens to be nearest. The probability here is a logistic regression of *right* on quantities
//! that show a wrong form: counted, not derived.

use serde::{Deserialize, Serialize};

use super::grounds;
use crate::gap::search::cross_validate::CrossValidation;
use crate::gap::search::diagnostics::SearchResult;
use crate::gap::search::support::{Support, decides};

/// The largest probability that is printed: no count of cases shows more.
pub const CEILING: f64 = 0.99;

/// The smallest probability that is printed.
pub const FLOOR: f64 = 0.01;

/// The quantities of an effect at the end of a search from which its probability follows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Traits {
    /// The posterior log odds of the types of its class against all other candidates.
    pub log_odds: f64,
    /// The share of the misfit on its own sensors that it closes, from 0 to 1.
    pub local: f64,
    /// The number of standard errors by which it predicts left-out data better than a free form in its place, for the
    /// kind of data where that is smallest; 0 without data that could be left out. Where two parts give no standard
    /// error, that of a normal likelihood ratio as large.
    pub transfer: f64,
    /// The share of the gap that all effects together close, from 0 to 1.
    pub closed: f64,
    /// The log Bayes factor of a remainder beside the effects.
    pub inexact: f64,
}

/// Coefficients of the regression.
struct Regression {
    /// The log odds where all quantities are zero.
    intercept: f64,
    /// The change of the log odds per unit of each of [`Traits::scaled`]; none is negative.
    slopes: [f64; 5],
}

/// The fit to 275 names of 234 cases of the worlds and the single records in `tests/generator`, 109 of them
/// with physics that no candidate has exactly: those of
/// `python bench/probability.py --cases 40 --records 82 --seed 33 --write`.
const FITTED: Regression =
    Regression { intercept: -4.229, slopes: [0.000, 4.550, 2.090, 0.986, 0.922] };

impl Traits {
    /// The quantities of an effect of a class, with the posterior probabilities of all types.
    pub(super) fn of(
        found: &SearchResult<'_>,
        support: &Support,
        class: &[String],
        types: &[(String, f64)],
    ) -> Self {
        let sum = |inside: bool| -> f64 {
            let own = types.iter().filter(|(kind, _)| class.contains(kind) == inside);
            own.map(|(_, p)| p).sum()
        };
        let standard = |c: &CrossValidation| match c.error.filter(|e| *e > 0.0) {
            Some(error) => c.difference / error,
            // If the free form were right, a log score in favour of the effect of at least `d` had a probability of at
            // most exp(-d): Markov's inequality.
            None => c.difference.signum() * (2.0 * c.difference.abs()).sqrt(),
        };
        let all = &support.against_free_form;
        let each = all.iter().filter(|one| decides(one, all)).map(standard);
        let least = f64::MIN_POSITIVE;
        Self {
            log_odds: sum(true).max(least).ln() - sum(false).max(least).ln(),
            local: support.local,
            transfer: each.reduce(f64::min).unwrap_or(0.0),
            closed: grounds::closed(found),
            inexact: found.last.tolerant.inexact,
        }
    }

    /// The posterior probability of the class, as if one of the candidates were exactly true.
    pub fn posterior(&self) -> f64 {
        1.0 / (1.0 + (-self.log_odds).exp())
    }

    /// The probability of a type of the class whose posterior probability is `own`: its part of that of the class.
    pub(super) fn of_type(&self, own: f64, class: &[String], types: &[(String, f64)]) -> f64 {
        let all = types.iter().filter(|(kind, _)| class.contains(kind)).map(|(_, p)| p);
        let share = own / all.sum::<f64>().max(f64::MIN_POSITIVE);
        self.probability() * share.min(1.0)
    }

    /// The quantities on scales from about 0 to 1, each so that a larger value is evidence for the name.
    fn scaled(&self) -> [f64; 5] {
        let within = |x: f64, low: f64, high: f64| {
            if x.is_nan() { low } else { x.clamp(low, high) }
        };
        [
            within(self.log_odds, -5.0, 10.0) / 10.0,
            within(self.local, 0.0, 1.0),
            within(self.transfer, -5.0, 10.0) / 10.0,
            within(self.closed, 0.0, 1.0),
            -within(self.inexact, 0.0, 100.0).ln_1p() / 5.0,
        ]
    }

    /// The probability that the class of the effect has the type that is missing; between 0.01 and [`CEILING`],
    /// and monotone in every quantity.
    pub fn probability(&self) -> f64 {
        let each = self.scaled().into_iter().zip(FITTED.slopes);
        let log_odds = FITTED.intercept + each.map(|(x, slope)| slope * x).sum::<f64>();
        (1.0 / (1.0 + (-log_odds).exp())).clamp(FLOOR, CEILING)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: Traits = Traits {
        log_odds: 1e3,
        local: 1.0,
        transfer: 1e3,
        closed: 1.0,
        inexact: f64::NEG_INFINITY,
    };
    const BAD: Traits =
        Traits { log_odds: -1e3, local: -1.0, transfer: -1e3, closed: -1.0, inexact: 1e6 };

    /// Sets one of the quantities.
    type Set = fn(&mut Traits, f64);

    /// Better evidence never lowers the probability, and no evidence makes it one.
    #[test]
    fn the_probability_is_bounded_and_rises_with_the_evidence() {
        assert!(GOOD.probability() <= CEILING && BAD.probability() >= FLOOR);
        assert!(GOOD.probability() > BAD.probability());
        let middle = Traits { log_odds: 3.0, local: 0.7, transfer: 2.0, closed: 0.7, inexact: 5.0 };
        let each: [(Set, [f64; 2]); 5] = [
            (|t, x| t.log_odds = x, [-10.0, 20.0]),
            (|t, x| t.local = x, [-0.5, 1.5]),
            (|t, x| t.transfer = x, [-10.0, 20.0]),
            (|t, x| t.closed = x, [-0.5, 1.5]),
            (|t, x| t.inexact = -x, [-200.0, 10.0]),
        ];
        for (set, [low, high]) in each {
            let mut before = 0.0;
            for k in 0..=60 {
                let mut own = middle;
                set(&mut own, low + (high - low) * f64::from(k) / 60.0);
                let now = own.probability();
                assert!(now >= before, "{own:?}: {now} after {before}");
                before = now;
            }
        }
    }

    /// A quantity that could not be computed counts as the worst.
    #[test]
    fn what_is_unknown_is_no_evidence() {
        let unknown = Traits { transfer: f64::NAN, ..GOOD };
        assert_eq!(unknown.probability(), Traits { transfer: -5.0, ..GOOD }.probability());
    }

    /// Of a class of two types that together have 0.8, the type with 0.6 has three quarters of its probability.
    #[test]
    fn a_type_has_its_part_of_the_class() {
        let types = [("a".to_owned(), 0.6), ("b".to_owned(), 0.2), ("c".to_owned(), 0.2)];
        let class = ["a".to_owned(), "b".to_owned()];
        let traits = Traits { log_odds: f64::ln(4.0), ..GOOD };
        assert!((traits.posterior() - 0.8).abs() < 1e-12);
        let told = traits.of_type(0.6, &class, &types);
        assert!((told - 0.75 * traits.probability()).abs() < 1e-12);
    }
}
