//! Residuals that are correlated along the last axis although the likelihood takes them as independent.

use super::words::short;
use super::{Finding, Rule, Severity};

const CODE: &str = "correlated_residuals";

/// How many times too narrow an interval may be: a reservation, and a failure. A 95 % interval that is 1.5 times too
/// narrow holds 81 %, one that is 3 times too narrow 49 %.
const NARROW: (f64, f64) = (1.5, 3.0);

const CORRELATED: &str = "use a discrepancy that knows it: `[discrepancy] use = \"autoregressive\"` or \
                          `\"gaussian_process\"`";

/// See [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![Rule {
        code: CODE,
        looks_at: "the autocorrelation time of the residuals along the last axis, over that in data simulated from the \
                   calibrated study"
            .to_owned(),
        threshold: format!(
            "a time so much longer that standard deviations are {} times too small: reservation; {} times: \
             failure",
            NARROW.0, NARROW.1
        ),
        why: "correlated data count as fewer: taken as independent, a 95 % interval holds 81 % where it is 1.5 times \
              too narrow, 49 % where it is 3 times",
        action: CORRELATED,
    }]
}

/// The autocorrelation time of the residuals in steps of the last axis, and those in simulated data, with the number of
/// data.
pub fn correlated(time: f64, simulated: &[f64], data: usize) -> Option<Finding> {
    let mut sorted = simulated.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (expected, most) = (*sorted.get(sorted.len() / 2)?, *sorted.last()?);
    if time <= most {
        return None;
    }
    let narrow = (time / expected).sqrt();
    if narrow.is_nan() || narrow < NARROW.0 {
        return None;
    }
    let severity = if narrow < NARROW.1 { Severity::Reservation } else { Severity::Failure };
    let effective = data as f64 * expected / time;
    let message = format!(
        "residuals stay alike for {} steps where the likelihood expects {}: {data} data are worth about {:.0}, and \
         standard deviations are about {} times too small",
        short(time),
        short(expected),
        effective,
        short(narrow)
    );
    Some(Finding::new((CODE, ""), (narrow, NARROW.0), severity, message, CORRELATED))
}
