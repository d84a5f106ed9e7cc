//! Data that dominate the posterior.

use super::words::{count, percent};
use super::{Finding, Rule, Severity};

const CODE: &str = "influential_data";

/// Fraction of data with unreliable leave-one-out estimates that gives a reservation.
const SHARE: f64 = 0.1;

const LOOK: &str = "check these data and the tails of the discrepancy; compare studies by their evidence or by \
                    held-out data, not by `elpd_loo`";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![Rule {
        code: CODE,
        looks_at: "the fraction of data whose k-hat is above its limit (PSIS-LOO)".to_owned(),
        threshold: format!("any: note; {}: reservation", percent(SHARE)),
        why: "without such a datum the posterior would be very different, so its leave-one-out prediction cannot be \
              estimated from the draws (Vehtari, Gelman and Gabry 2017)",
        action: LOOK,
    }]
}

/// Finding about `unreliable` of `of` data with unreliable leave-one-out estimates.
pub fn influential(unreliable: usize, of: usize) -> Option<Finding> {
    if unreliable == 0 {
        return None;
    }
    let share = unreliable as f64 / of.max(1) as f64;
    let severity = if share < SHARE { Severity::Note } else { Severity::Reservation };
    let message = format!(
        "k-hat is above its limit for {unreliable} of {}: `elpd_loo` is unreliable",
        count(of, "value")
    );
    Some(Finding::new((CODE, ""), (share, SHARE), severity, message, LOOK))
}
