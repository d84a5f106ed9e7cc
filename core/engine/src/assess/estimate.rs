//! Estimates of a likelihood from runs of a stochastic model.

use super::words::short;
use super::{Finding, Rule, Severity};

const ESTIMATE: &str = "likelihood_estimate";
const STICKING: &str = "sticking_chain";
const DETERMINISTIC: &str = "deterministic_model";

/// Variance of the log-likelihood's estimate above which a chain needs many more steps than the saved runs are worth.
const LARGEST: f64 = 3.0;
/// Variance that further runs should aim at: the middle of the range from 1 to 3 that the literature recommends.
const AIM: f64 = 1.7;
/// Share of its steps for which a chain may stay at one point.
const STAY: f64 = 0.05;

const MORE: &str =
    "raise `simulations` of `[discrepancy]`: the variance falls in inverse proportion to it";
const OTHER: &str = "use a discrepancy for deterministic models; if this one should be random, check that it uses its seed";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![
        Rule {
            code: ESTIMATE,
            looks_at: "variance of the log-likelihood's estimate at the median of the posterior, from 50 estimates".to_owned(),
            threshold: format!("above {LARGEST}: reservation"),
            why: "the cost of a given accuracy is smallest at a variance of 1 to 3 (Doucet et al. 2015; Sherlock et al. \
                  2015); above, chains stay for long where the estimate happens to be large",
            action: MORE,
        },
        Rule {
            code: STICKING,
            looks_at: "longest stay of a chain at one point, if the likelihood is estimated from runs of a stochastic model"
                .to_owned(),
            threshold: format!("above {} % of its steps: reservation", 100.0 * STAY),
            why: "the point counts that often in every summary because its estimate is large by chance",
            action: MORE,
        },
        Rule {
            code: DETERMINISTIC,
            looks_at: "50 estimates of a likelihood with different seeds at the median of the posterior".to_owned(),
            threshold: "all equal: reservation".to_owned(),
            why: "either the model ignores its seed, or every run beyond the first is wasted",
            action: OTHER,
        },
    ]
}

/// Finding about the variance of a log-likelihood's estimate from so many runs; the variance of an estimate that may be zero
/// is `None`.
pub fn variance(variance: Option<f64>, runs: usize) -> Option<Finding> {
    if variance.is_some_and(|variance| variance <= LARGEST) {
        return None;
    }
    let message = if let Some(variance) = variance {
        format!(
            "the estimate of the log-likelihood has the variance {} with {runs} runs of the model, and 1 to 3 is best: \
             {} times as many would give {AIM}",
            short(variance),
            short(variance / AIM)
        )
    } else {
        format!(
            "with {runs} runs of the model the likelihood is estimated as zero in the middle of the posterior"
        )
    };
    let figures = (variance.unwrap_or(f64::INFINITY), LARGEST);
    Some(Finding::new((ESTIMATE, ""), figures, Severity::Reservation, message, MORE))
}

/// Finding about the longest stay of a chain, as a share of its steps.
pub fn sticking(stay: f64) -> Option<Finding> {
    let message = format!(
        "a chain stayed at one point for {} % of its steps, where the estimate of the likelihood is large by chance",
        short(100.0 * stay)
    );
    let found = Finding::new((STICKING, ""), (stay, STAY), Severity::Reservation, message, MORE);
    (stay > STAY).then_some(found)
}

/// Finding about a model that returns the same response for every seed.
pub fn deterministic() -> Finding {
    let message = "the model returns the same response for every seed: it is not random, and one run of it is enough";
    let figures = (0.0, 0.0);
    Finding::new((DETERMINISTIC, ""), figures, Severity::Reservation, message.to_owned(), OTHER)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_variance_above_three_asks_for_more_runs() {
        assert_eq!(variance(Some(3.0), 10), None);
        let found = variance(Some(5.1), 10).map(|finding| finding.message).unwrap_or_default();
        assert!(found.contains("3.00 times as many"), "{found}");
        assert!(variance(None, 10).is_some_and(|finding| finding.figure.is_none()));
        assert_eq!(sticking(0.05), None);
        assert!(sticking(0.051).is_some());
    }
}
