//! Data that the posterior hangs on.

use super::words::{count, percent};
use super::{Finding, Rule, Severity};

const CODE: &str = "influential_data";

/// The share of data with estimates not to trust that is a reservation.
const SHARE: f64 = 0.1;

const LOOK: &str = "look at these data and at the tails of the discrepancy; compare studies by their evidence or by data set \
                    aside, not by this sum";

/// See [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![Rule {
        code: CODE,
        looks_at: "the share of data whose k-hat is above its limit (PSIS-LOO)".to_owned(),
        threshold: format!("any: note; {}: reservation", percent(SHARE)),
        why: "without such a datum the posterior were another one: the predictions of left-out data cannot be had \
              from its draws (Vehtari, Gelman and Gabry 2017)",
        action: LOOK,
    }]
}

/// So many of the data have estimates that cannot be trusted.
pub fn influential(unreliable: usize, of: usize) -> Option<Finding> {
    if unreliable == 0 {
        return None;
    }
    let share = unreliable as f64 / of.max(1) as f64;
    let severity = if share < SHARE { Severity::Note } else { Severity::Reservation };
    let message = format!(
        "the posterior without each of {unreliable} of {} cannot be had from the draws: the sum of their \
         predictions (`loo`) is not to be relied on",
        count(of, "value")
    );
    Some(Finding::new((CODE, ""), (share, SHARE), severity, message, LOOK))
}
